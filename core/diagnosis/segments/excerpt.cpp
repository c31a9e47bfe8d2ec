#include "core/diagnosis/segments/excerpt.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/segments/windows.hpp"

namespace invar::diagnosis {

namespace {

/// What candidates may cost to be ranked, in rows that are run through; fewer rows of a recording rank nothing.
constexpr double affordable = 1.5e6, fewest_rows = 1500.0;
/// What shows at the end of a recording alone should be seen too.
constexpr std::size_t stretches = 4;

std::vector<double> part(const std::vector<double>& values, std::size_t begin, std::size_t rows) {
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(begin);
  return {first, first + static_cast<std::ptrdiff_t>(rows)};
}

}  // namespace

std::optional<Excerpt> excerpt(const Case& whole, const Weighing& weighing, const Fit& base,
                               std::size_t runs) {
  if (whole.model.plant != physics::Plant::equations || whole.model.equations.states.empty())
    return std::nullopt;
  double rows = 0.0;
  for (const auto& recording : whole.recordings) {
    rows += static_cast<double>(recording.inputs.rows());
    if (!recording.inputs.restarts.empty()) return std::nullopt;
  }
  const double share =
      std::max(fewest_rows, affordable / static_cast<double>(std::max<std::size_t>(1, runs))) / rows;
  if (share > 0.6) return std::nullopt;  // the excerpt itself costs something

  Excerpt some{whole, weighing, {}, share};
  some.data.recordings.clear();
  some.data.remembered = std::make_shared<Remembered>();
  some.weighing.present.clear();
  some.weighing.rows = 0;
  const auto shown = showing_states(base.model);
  const auto& states = whole.model.equations.states;
  auto model = base.model;
  for (std::size_t r = 0; r < whole.recordings.size(); ++r) {
    const auto& recording = whole.recordings[r];
    const std::size_t n = recording.inputs.rows();
    const auto length = static_cast<std::size_t>(share * static_cast<double>(n)) / stretches;
    if (length < 2) continue;
    physics::Outputs at;
    physics::prepare(shown, recording.inputs)->run(shown, at);
    for (std::size_t s = 0; s < stretches; ++s) {
      const std::size_t begin = s * (n - length) / (stretches - 1);
      auto& stretch = some.data.recordings.emplace_back();
      stretch.name = recording.name;
      stretch.inputs.time = part(recording.inputs.time, begin, length);
      stretch.inputs.turn = recording.inputs.turn;
      for (const auto& [name, values] : recording.inputs.signals)
        stretch.inputs.signals[name] = part(values, begin, length);
      auto& present = some.weighing.present.emplace_back();
      for (std::size_t o = 0; o < whole.outputs.size(); ++o) {
        stretch.measured.push_back(part(recording.measured[o], begin, length));
        const auto& all = weighing.present[r][o];
        const auto first = all.begin() + static_cast<std::ptrdiff_t>(begin);
        present.emplace_back(first, first + static_cast<std::ptrdiff_t>(length));
        some.weighing.rows += static_cast<Eigen::Index>(length);
      }
      if (begin == 0) continue;  // as the recording begins
      stretch.inputs.first_restart = (model.parameters.size() - base.model.parameters.size()) / states.size();
      stretch.inputs.restarts = {0};
      for (std::size_t i = 0; i < states.size(); ++i) {
        const auto& initial = *whole.model.find(states[i].name + ".initial");
        double size = 1e-9;
        for (const double v : at[i])
          if (std::isfinite(v)) size = std::max(size, std::abs(v));
        const double value = std::isfinite(at[i][begin]) ? at[i][begin] : initial.value;
        model.parameters.push_back({states[i].name + ".start" + std::to_string(stretch.inputs.first_restart),
                                    initial.unit, value, size, initial.bounds});
      }
    }
  }
  const auto own = static_cast<std::ptrdiff_t>(base.model.parameters.size());
  some.data.model.parameters.insert(some.data.model.parameters.end(), model.parameters.begin() + own,
                                    model.parameters.end());
  for (auto& stretch : some.data.recordings)
    stretch.simulation = physics::prepare(some.data.model, stretch.inputs);
  some.base = fit(some.data, some.weighing, model, some.data.model, 3);
  return some;
}

Fit on_all(const Case& whole, const Weighing& weighing, const Fit& base, const Fit& of_excerpt) {
  auto model = of_excerpt.model;
  model.parameters.resize(
      base.model.parameters.size());  // without the states at the beginning of its stretches
  for (std::size_t i = 0; i < model.parameters.size(); ++i)
    if (model.parameters[i].name.ends_with(".initial")) model.parameters[i] = base.model.parameters[i];
  return fit(whole, weighing, model, whole.model, 2, &base);
}

}  // namespace invar::diagnosis
