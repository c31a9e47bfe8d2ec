#include "core/diagnosis/candidates/wave.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/locate/axis_periods.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;

/// Of one output, residuals in bins over a variable. Where an effect goes with a factor, each row counts by its square.
struct Binned {
  static constexpr std::size_t bins = 4096;
  std::vector<double> sums = std::vector<double>(bins, 0.0), weights = std::vector<double>(bins, 0.0);
  double low = 0.0, span = 0.0, rows = 0.0;
};

std::optional<Binned> binned(const Case& data, const std::vector<physics::Outputs>& simulated,
                             std::size_t output, const char* over, const char* factor) {
  struct Row {
    double at, left, factor;
  };
  std::vector<Row> rows;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto at = variable_values(data, r, over);
    const auto times =
        factor != nullptr ? variable_values(data, r, factor) : std::vector<double>(at.size(), 1.0);
    for (std::size_t i = 0; i < at.size(); ++i)
      if (const double left = data.recordings[r].measured[output][i] - simulated[r][output][i];
          std::isfinite(left) && std::isfinite(at[i]) && std::isfinite(times[i]))
        rows.push_back({at[i], left, times[i]});
  }
  if (rows.size() < 20) return std::nullopt;
  const auto [first, last] =
      std::minmax_element(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.at < b.at; });
  Binned all;
  all.low = first->at, all.span = last->at - first->at, all.rows = static_cast<double>(rows.size());
  if (!(all.span > 0.0)) return std::nullopt;
  for (const auto& row : rows) {
    const auto bin =
        static_cast<std::size_t>((row.at - all.low) / all.span * static_cast<double>(Binned::bins - 1));
    all.sums[bin] += row.left * row.factor, all.weights[bin] += row.factor * row.factor;
  }
  return all;
}

}  // namespace

std::vector<Start> wave_starts(const Case& data, const Fit& fitted) {
  constexpr std::size_t knots = 10;  // to a period: straight lines between them are a sine to two percent
  constexpr double least = 3.0;      // waves: fewer are any course
  struct Choice {
    const char *site, *over, *with;
  };
  std::vector<Choice> choices;
  if (data.model.plant == Plant::error_map) choices = {{"kinematic", "time", nullptr}};
  if (data.model.plant == Plant::droplet) choices = {{"flight", "time", nullptr}};
  if (data.model.plant == Plant::sensor)
    choices = {{"measurement", "time", nullptr}, {"measurement", "true_position", "velocity"}};
  std::vector<Start> starts;
  if (choices.empty()) return starts;
  const auto simulated = simulate(data, fitted.model);
  for (const auto& choice : choices)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      if (choice.with != nullptr && data.outputs[o] != "velocity_sensor") continue;
      const auto all = binned(data, simulated, o, choice.over, choice.with);
      if (!all) continue;
      for (const double pitch : long_pitches(all->sums, all->weights, all->span)) {
        const double waves = all->span / pitch;
        if (waves < least || 4.0 * waves > all->rows) continue;
        Start start;
        start.term.info = physics::unmodelled(data.model.plant, choice.site);
        if (data.model.plant != Plant::error_map) start.term.on = data.outputs[o];
        if (choice.with != nullptr) start.term.with = choice.with;
        auto& curve = start.term.curve;
        curve.over = choice.over, curve.period = pitch;
        for (std::size_t k = 0; k < knots; ++k) {
          curve.knots.push_back(pitch * static_cast<double>(k) / static_cast<double>(knots));
          curve.values.push_back(0.0);
          start.directions.push_back({physics::most_parameters, k, false});
        }
        starts.push_back(std::move(start));
        break;  // the best
      }
    }
  return starts;
}

}  // namespace invar::diagnosis
