#include "core/diagnosis/segments/excerpt.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/segments/windows.hpp"

namespace invar::diagnosis {

namespace {

/// What candidates may cost to be ranked, in rows that are run through; fewer rows of a recording rank nothing.
constexpr double affordable = 1.5e6, fewest_rows_to_rank = 1500.0;
/// What shows at the end of a recording alone should be seen too.
constexpr std::size_t stretches = 4;

std::vector<double> part(const std::vector<double>& values, std::size_t begin, std::size_t rows) {
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(begin);
  return {first, first + static_cast<std::ptrdiff_t>(rows)};
}

/// So many rows from `begin` on; returns the inputs.
physics::Record& add_stretch(const Case& whole, const Weighing& weighing, std::size_t r, std::size_t begin,
                             std::size_t rows, Excerpt& some) {
  const auto& recording = whole.recordings[r];
  auto& stretch = some.data.recordings.emplace_back();
  stretch.name = recording.name;
  stretch.inputs.time = part(recording.inputs.time, begin, rows);
  stretch.inputs.turn = recording.inputs.turn;
  for (const auto& [name, values] : recording.inputs.signals)
    stretch.inputs.signals[name] = part(values, begin, rows);
  auto& present = some.weighing.present.emplace_back();
  for (std::size_t o = 0; o < whole.outputs.size(); ++o) {
    stretch.measured.push_back(part(recording.measured[o], begin, rows));
    const auto& all = weighing.present[r][o];
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(begin);
    present.emplace_back(first, first + static_cast<std::ptrdiff_t>(rows));
    some.weighing.rows += static_cast<Eigen::Index>(rows);
  }
  return stretch.inputs;
}

/// The states at row `begin` as further parameters, so that a stretch may start there; `at`: the states by row.
void add_start_states(const Case& whole, const physics::Outputs& at, std::size_t begin, std::size_t restart,
                      physics::Model& model) {
  const auto& states = whole.model.equations.states;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const auto& initial = *whole.model.find(states[i].name + ".initial");
    double size = 1e-9;
    for (const double v : at[i])
      if (std::isfinite(v)) size = std::max(size, std::abs(v));
    const double value = std::isfinite(at[i][begin]) ? at[i][begin] : initial.value;
    model.parameters.push_back(
        {states[i].name + ".start" + std::to_string(restart), initial.unit, value, size, initial.bounds});
  }
}

/// The share of the rows that the candidates may cost; nothing where an excerpt saves little or cannot be cut.
std::optional<double> affordable_share(const Case& whole, std::size_t runs) {
  if (whole.model.plant != physics::Plant::equations || whole.model.equations.states.empty())
    return std::nullopt;
  double rows = 0.0;
  for (const auto& recording : whole.recordings) {
    rows += static_cast<double>(recording.inputs.rows());
    if (!recording.inputs.restarts.empty()) return std::nullopt;
  }
  const double share =
      std::max(fewest_rows_to_rank, affordable / static_cast<double>(std::max<std::size_t>(1, runs))) / rows;
  if (share > 0.6) return std::nullopt;  // the excerpt itself costs something
  return share;
}

}  // namespace

std::optional<Excerpt> excerpt(const Case& whole, const Weighing& weighing, const Fit& base,
                               std::size_t runs) {
  const auto share = affordable_share(whole, runs);
  if (!share) return std::nullopt;
  Excerpt some{whole, weighing, {}, *share};
  some.data.recordings.clear();
  some.data.remembered = std::make_shared<Remembered>();
  some.weighing.present.clear();
  some.weighing.rows = 0;
  const auto shown = showing_states(base.model);
  const std::size_t own = base.model.parameters.size(), states = whole.model.equations.states.size();
  auto model = base.model;
  for (std::size_t r = 0; r < whole.recordings.size(); ++r) {
    const auto& inputs = whole.recordings[r].inputs;
    const std::size_t n = inputs.rows();
    const auto length = static_cast<std::size_t>(*share * static_cast<double>(n)) / stretches;
    if (length < 2) continue;
    physics::Outputs at;
    physics::prepare(shown, inputs)->run(shown, at);
    for (std::size_t s = 0; s < stretches; ++s) {
      const std::size_t begin = s * (n - length) / (stretches - 1);
      auto& stretch = add_stretch(whole, weighing, r, begin, length, some);
      if (begin == 0) continue;  // as the recording begins
      stretch.first_restart = (model.parameters.size() - own) / states;
      stretch.restarts = {0};
      add_start_states(whole, at, begin, stretch.first_restart, model);
    }
  }
  some.data.model.parameters.insert(some.data.model.parameters.end(),
                                    model.parameters.begin() + static_cast<std::ptrdiff_t>(own),
                                    model.parameters.end());
  for (auto& stretch : some.data.recordings)
    stretch.simulation = physics::prepare(some.data.model, stretch.inputs);
  some.base = fit(some.data, some.weighing, model, some.data.model, Effort::polish(3));
  return some;
}

Fit on_all(const Case& whole, const Weighing& weighing, const Fit& base, const Fit& of_excerpt) {
  auto model = of_excerpt.model;
  model.parameters.resize(
      base.model.parameters.size());  // without the states at the beginning of its stretches
  for (std::size_t i = 0; i < model.parameters.size(); ++i)
    if (model.parameters[i].name.ends_with(".initial")) model.parameters[i] = base.model.parameters[i];
  return fit(whole, weighing, model, whole.model, Effort::polish(2), &base);
}

}  // namespace invar::diagnosis
