#include "core/diagnosis/dataset/initial_state.hpp"
#include "core/diagnosis/dataset/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace invar::diagnosis {

namespace {

/// Heat is slow: the straight line through the first rows (Theil and Sen's: one slip among them moves it little), at the first
/// of them, and what of the noise of one row is left in it. Nothing where too few were read.
std::optional<std::pair<double, double>> line_at_first(const std::vector<double>& time,
                                                       const std::vector<double>& values) {
  constexpr std::size_t most = 8, enough = 5;
  std::vector<std::pair<double, double>> rows;
  for (std::size_t i = 0; i < std::min(most, values.size()); ++i)
    if (std::isfinite(values[i])) rows.emplace_back(time[i] - time[0], values[i]);
  if (rows.size() < enough) return std::nullopt;
  std::vector<double> slopes, levels;
  double t = 0.0, tt = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    t += rows[i].first, tt += rows[i].first * rows[i].first;
    for (std::size_t k = 0; k < i; ++k)
      slopes.push_back((rows[i].second - rows[k].second) / (rows[i].first - rows[k].first));
  }
  const double slope = median(slopes);
  for (const auto& [after, value] : rows) levels.push_back(value - slope * after);
  const double n = static_cast<double>(rows.size());
  return std::pair{median(levels), std::sqrt(tt / (n * tt - t * t))};
}

/// What a reading is from the first row on while the reference rests, where that is off what is expected by less than one
/// reading tells. Nothing where too few rows were read before the reference moves, or where it goes elsewhere.
std::optional<double> rests_beside(double expected, const std::vector<double>& reference,
                                   const std::vector<double>& values) {
  constexpr std::size_t enough = 50, first = 10;    // rows
  constexpr double plainly_off = 4.0, alike = 2.5;  // standard errors
  double sum = 0.0, sum_of_first = 0.0, count = 0.0, count_of_first = 0.0;
  std::size_t rows = 0;
  for (; rows < values.size() && reference[rows] == reference[0]; ++rows) {
    if (!std::isfinite(values[rows])) continue;
    sum += values[rows], ++count;
    if (rows < first) sum_of_first += values[rows], ++count_of_first;
  }
  if (rows < enough || count < 0.5 * static_cast<double>(rows) || count_of_first == 0.0) return std::nullopt;
  const double mean = sum / count, spread = spread_of_differences(
                                       {values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rows)});
  const bool is_off = std::abs(mean - expected) > plainly_off * spread / std::sqrt(count),
             from_the_first_on =
                 std::abs(sum_of_first / count_of_first - mean) < alike * spread / std::sqrt(count_of_first);
  return is_off && from_the_first_on ? std::optional{mean} : std::nullopt;
}

/// An initial state is a column whose first row alone is filled.
void give_first(physics::Record& inputs, const std::string& signal, double value) {
  auto& column = inputs.signals[signal];
  column.assign(inputs.rows(), no_reading);
  column.front() = value;
}

/// [m/s] The steady speed at which a carriage comes into the recording; nothing where it rests, or begins to move.
std::optional<double> comes_at(const std::vector<double>& time, const std::vector<double>& position) {
  constexpr std::size_t rows = 8;
  constexpr double alike = 0.2, plainly = 10.0;
  if (position.size() < rows ||
      !std::all_of(position.begin(), position.begin() + rows, [](double v) { return std::isfinite(v); }))
    return std::nullopt;
  const auto speed = [&](std::size_t from, std::size_t to) {
    return (position[to] - position[from]) / (time[to] - time[from]);
  };
  const double v = speed(0, rows - 1), early = speed(0, rows / 2 - 1), late = speed(rows / 2, rows - 1);
  const double noise = spread_of_differences(position) / (time[rows / 2 - 1] - time[0]);
  if (!(std::abs(v) > plainly * noise) || std::abs(early - late) > alike * std::abs(v) + 3.0 * noise)
    return std::nullopt;
  return early - 0.375 * (late - early);  // at the first row, 1.5 rows before the middle of the early half
}

}  // namespace

void give_start_of_sum(const Case& data, Recording& recording) {
  auto& inputs = recording.inputs;
  const auto* reference = inputs.find("reference");
  const auto* forward = inputs.find("feedforward");
  if (!data.model.controller || reference == nullptr || inputs.rows() < 8) return;
  const auto& position = recording.measured[0];
  const auto& current = recording.measured[1];
  if ((*reference)[5] != (*reference)[0] || !std::isfinite(position[0]) || !std::isfinite(current[0])) return;
  physics::AxisController fresh{*data.model.controller};
  const double expected =
      fresh.step((*reference)[0], position[0]) + (forward != nullptr ? forward->front() : 0.0);
  if (!(std::abs(current[0] - expected) > 6.0 * spread_of_differences(current))) return;
  give_first(inputs, "current", rests_beside(expected, *reference, current).value_or(current[0]));
}

void give_start(Case& data, Recording& recording) {
  using physics::Plant;
  auto& inputs = recording.inputs;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto& name = data.outputs[o];
    // The very first value alone: a few rows later the machine may be on its way.
    double begin = no_reading;
    for (std::size_t i = 0; i < std::min<std::size_t>(2, inputs.rows()) && !std::isfinite(begin); ++i)
      begin = recording.measured[o][i];
    double spread = 1.5 * spread_of_differences(recording.measured[o]);
    double expected = no_reading, doubt = 0.0;
    if (data.model.plant == Plant::thermal) {
      const auto* ambient = inputs.find("ambient");
      expected = ambient != nullptr ? ambient->front() : data.model.value("ambient", 20.0);
      if (ambient == nullptr && data.model.find("ambient")->sigma) doubt = *data.model.find("ambient")->sigma;
      if (ambient != nullptr) doubt = 1.5 * spread_of_differences(*ambient);
      if (const auto line = line_at_first(inputs.time, recording.measured[o])) {
        begin = line->first;
        spread *= line->second;
      }
    } else if (data.model.plant == Plant::axis && name == "position") {
      const auto* reference = inputs.find("reference");
      expected = data.model.controller && reference != nullptr ? reference->front() : 0.0;
      doubt = 1e-6;
      if (reference != nullptr && reference->size() > 5) doubt += std::abs((*reference)[5] - (*reference)[0]);
    }
    if (const auto* reference = inputs.find("reference");
        data.model.controller && reference != nullptr && name == "position")
      if (const auto at = rests_beside(reference->front(), *reference, recording.measured[o]))
        begin = *at, spread = doubt = 0.0;
    // A loop without a sum may have been on its way: its first rows say how it came.
    const bool has_no_sum = name == "position" && data.model.controller &&
                            data.model.controller->kind == physics::AxisControllerSettings::Kind::cascade;
    const auto speed = has_no_sum ? comes_at(inputs.time, recording.measured[o]) : std::nullopt;
    if (speed) doubt = 1e-6;
    if (!std::isfinite(begin) || !std::isfinite(expected) ||
        !(std::abs(begin - expected) > 4.0 * std::hypot(spread, doubt)))
      continue;
    give_first(inputs, name, begin);
    if (speed) give_first(inputs, "velocity", *speed);
  }
}

}  // namespace invar::diagnosis
