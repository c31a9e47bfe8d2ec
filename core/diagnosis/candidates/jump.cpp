#include "core/diagnosis/candidates/jump.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;

struct Jump {
  double before, after;  // of the variable
};

/// Where two means describe the values best, in the order of the variable: the largest difference against its own error.
std::optional<Jump> jump_in(std::vector<std::pair<double, double>> points) {
  std::erase_if(points, [](const auto& p) { return !std::isfinite(p.first) || !std::isfinite(p.second); });
  std::sort(points.begin(), points.end());
  const std::size_t n = points.size(), least = std::max<std::size_t>(5, n / 20);
  if (n < 4 * least) return std::nullopt;
  double best = 0.0;
  std::optional<Jump> jump;
  std::vector<double> sums{0.0}, steps;
  for (const auto& p : points) sums.push_back(sums.back() + p.second);
  double step = 0.0;
  for (std::size_t i = least; i + least < n; ++i) {
    const double here = std::abs(sums[i + least] - 2.0 * sums[i] + sums[i - least]);
    steps.push_back(here);
    if (!(points[i].first > points[i - 1].first)) continue;
    const auto k = static_cast<double>(i), rows = static_cast<double>(n);
    const double apart = sums[i] - k / rows * sums[n], gain = apart * apart / (k * (rows - k));
    if (gain > best) best = gain, step = here, jump = Jump{points[i - 1].first, points[i].first};
  }
  // Noise that wanders goes as far in many a place.
  constexpr double far = 5.0;
  if (step < far * 1.4826 * median(std::move(steps))) return std::nullopt;
  return jump;
}

}  // namespace

std::vector<Start> jump_starts(const Case& data, const Fit& fitted) {
  struct Choice {
    const char* site;
    const char* over;
  };
  std::vector<Choice> choices;
  if (data.model.plant == Plant::error_map) choices = {{"kinematic", "time"}, {"kinematic", "position"}};
  if (data.model.plant == Plant::droplet) choices = {{"flight", "time"}};
  if (data.model.plant == Plant::sensor)
    choices = {{"measurement", "time"}, {"measurement", "true_position"}};
  std::vector<Start> starts;
  if (choices.empty()) return starts;
  const auto simulated = simulate(data, fitted.model);
  for (const auto& choice : choices)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      std::vector<std::pair<double, double>> points;
      for (std::size_t r = 0; r < data.recordings.size(); ++r) {
        const auto values = variable_values(data, r, choice.over);
        for (std::size_t i = 0; i < values.size(); ++i)
          points.emplace_back(values[i], data.recordings[r].measured[o][i] - simulated[r][o][i]);
      }
      if (points.empty()) continue;
      const auto [low, high] = std::minmax_element(points.begin(), points.end());
      const double first = low->first, last = high->first;
      const auto jump = jump_in(std::move(points));
      if (!jump || !(jump->before > first) || !(last > jump->after)) continue;
      Start start;
      start.term.info = physics::unmodelled(data.model.plant, choice.site);
      if (data.model.plant != Plant::error_map) start.term.on = data.outputs[o];
      start.term.curve.over = choice.over;
      start.term.curve.knots = {first, jump->before, jump->after, last};
      start.term.curve.values.assign(4, 0.0);
      for (std::size_t k = 0; k < 4; ++k) start.directions.push_back({physics::most_parameters, k, false});
      starts.push_back(std::move(start));
    }
  return starts;
}

}  // namespace invar::diagnosis
