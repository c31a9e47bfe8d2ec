#include "core/diagnosis/estimate/unknown_sizes.hpp"

#include <cmath>
#include <functional>
#include <optional>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

namespace {

/// `set(model, size)`; 0 where no size changes anything.
double usual_size(const Case& data, const Weighing& weighing, const Eigen::VectorXd& as_written,
                  const Range& bounds, const std::function<void(physics::Model&, double)>& set) {
  const double sign = bounds.contains(1e-12) ? 1.0 : -1.0;
  double last = 0.0;
  for (double size = 1e-12; size < 1e12 && bounds.contains(sign * size); size *= 10.0) {
    auto model = data.model;
    set(model, sign * size);
    const Eigen::VectorXd change =
        whitened(data, weighing, differences(data, simulate_once(data, model)) - as_written);
    if (!change.allFinite()) break;  // no such machine
    if (change.squaredNorm() > 0.0) last = size;
    if (change.squaredNorm() >= static_cast<double>(weighing.rows)) break;
  }
  return last;
}

}  // namespace

void find_unknown_sizes(Case& data) {
  std::optional<Weighing> weighing;
  Eigen::VectorXd as_written;
  const auto size_of = [&](const Range& bounds, const std::function<void(physics::Model&, double)>& set) {
    if (!weighing) {
      const auto simulated = simulate(data, data.model);
      weighing = weigh(data, simulated, Colour::white);
      as_written = differences(data, simulated);
    }
    return usual_size(data, *weighing, as_written, bounds, set);
  };
  auto& model = data.model;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const auto& parameter = model.parameters[i];
    if (parameter.value != 0.0 || parameter.sigma) continue;
    Freedom freedom;
    freedom.index = i;
    model.parameters[i].usual =
        size_of(parameter.bounds, [&](physics::Model& m, double size) { diagnosis::set(m, freedom, size); });
  }
  for (std::size_t t = 0; t < model.terms.size(); ++t)
    for (std::size_t i = 0; i < model.terms[t].info->parameter_count(); ++i) {
      auto& term = model.terms[t];
      const auto& info = term.info->parameters[i];
      if (!term.given[i] || term.values[i] != 0.0 || term.sigmas[i] || info.role != physics::Role::amplitude)
        continue;
      term.usual[i] =
          size_of(info.bounds, [&](physics::Model& m, double size) { m.terms[t].values[i] = size; });
    }
}

}  // namespace invar::diagnosis
