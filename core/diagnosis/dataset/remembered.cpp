#include "core/diagnosis/dataset/remembered.hpp"

#include <algorithm>

namespace invar::diagnosis {

namespace {

constexpr std::size_t most = 10;  // runs; of a long recording half a megabyte each

bool same(const std::vector<physics::Parameter>& a, const std::vector<physics::Parameter>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& one, const auto& other) {
    return one.value == other.value && one.name == other.name;
  });
}

bool same(const std::vector<physics::Term>& a, const std::vector<physics::Term>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& one, const auto& other) {
    return one.info == other.info && one.values == other.values && one.on == other.on &&
           one.with == other.with && one.curve.values == other.curve.values &&
           one.curve.knots == other.curve.knots && one.curve.over == other.curve.over &&
           one.curve.period == other.curve.period && one.curve.memory == other.curve.memory;
  });
}

}  // namespace

std::optional<Remembered::Outputs> Remembered::find(const physics::Model& model,
                                                    const Simulations& recordings) const {
  const std::scoped_lock lock{mutex_};
  for (const auto& run : runs_)
    if (same(run.parameters, model.parameters) && same(run.terms, model.terms) &&
        run.recordings == recordings)
      return run.outputs;
  return std::nullopt;
}

void Remembered::keep(const physics::Model& model, const Simulations& recordings, const Outputs& outputs) {
  const std::scoped_lock lock{mutex_};
  if (runs_.size() >= most) runs_.pop_back();
  runs_.push_front({model.parameters, model.terms, recordings, outputs});
}

}  // namespace invar::diagnosis
