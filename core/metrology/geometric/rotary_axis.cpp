#include "core/metrology/geometric/rotary_axis.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace invar::metrology {

namespace {

constexpr double turn = 2.0 * std::numbers::pi;
constexpr double same_turn = 1e-3;                // rad: limits of a travel are rounded to three digits
constexpr double overlap = std::numbers::pi / 3;  // readings repeated beyond either end; also the widest gap

/// Within [lower, lower + turn).
double folded(double angle, double lower) noexcept {
  const double place = std::fmod(angle - lower, turn);
  return lower + (place < 0.0 ? place + turn : place);
}

bool closes(const ErrorMotionReadings& readings, const Range& travel) {
  if (std::abs(travel.width() - turn) > same_turn) return false;
  std::vector<double> places;
  for (const double position : readings.position) places.push_back(folded(position, travel.lower));
  std::sort(places.begin(), places.end());
  double gap = places.front() + turn - places.back();
  for (std::size_t i = 1; i < places.size(); ++i) gap = std::max(gap, places[i] - places[i - 1]);
  return gap <= overlap;
}

/// Readings within one turn, and behind them those near an end once more beyond the other end: the curve comes round.
ErrorMotionReadings around(const ErrorMotionReadings& readings, double lower) {
  std::vector<Eigen::Index> rows;
  std::vector<double> places;
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    rows.push_back(i);
    places.push_back(folded(readings.position[i], lower));
  }
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    const double place = places[static_cast<std::size_t>(i)];
    if (place > lower + overlap && place < lower + turn - overlap) continue;
    rows.push_back(i);
    places.push_back(place <= lower + overlap ? place + turn : place - turn);
  }
  ErrorMotionReadings result;
  result.position =
      Eigen::Map<const Eigen::VectorXd>(places.data(), static_cast<Eigen::Index>(places.size()));
  result.value = readings.value(rows);
  result.state.resize(0, result.position.size());
  if (!readings.direction.empty())
    for (const Eigen::Index row : rows)
      result.direction.push_back(readings.direction[static_cast<std::size_t>(row)]);
  return result;
}

}  // namespace

double RotaryAxis::place(double angle) const noexcept {
  return comes_round ? folded(angle, travel.lower) : travel.clamp(angle);
}

double RotaryAxis::value(double angle, double moving) const {
  const double at = place(angle);
  return error.value(at, {}) + 0.5 * moving * reversal.value(at);
}

double RotaryAxis::sigma(double angle, double moving) const noexcept {
  const double at = comes_round ? place(angle) : angle;
  const double own = error.sigma_at(at, {});
  return moving == 0.0 ? own : std::hypot(own, 0.5 * moving * reversal.sigma_at(place(angle)));
}

RotaryFit identify_rotary(char letter, const ErrorMotionReadings& readings, const Range& travel) {
  RotaryFit result;
  RotaryAxis& axis = result.axis;
  axis.letter = letter;
  axis.comes_round = closes(readings, travel);
  ErrorMotionReadings used = readings;
  axis.travel = {readings.position.minCoeff(), readings.position.maxCoeff()};
  if (axis.comes_round) {
    axis.travel = {travel.lower, travel.lower + turn};
    used = around(readings, travel.lower);
  }
  if (!used.direction.empty()) {
    const Range known{used.position.minCoeff(), used.position.maxCoeff()};
    axis.reversal = reversal_of_readings(used.position, used.value, used.direction, known);
    used = without_reversal(std::move(used), axis.reversal);
  }
  result.fit = identify_error_motion(used);
  axis.error = result.fit.motion;
  const auto count = static_cast<std::size_t>(readings.position.size());
  result.fit.kept.resize(count);
  result.fit.rest.resize(count);
  result.fit.rejected =
      static_cast<std::size_t>(std::count(result.fit.kept.begin(), result.fit.kept.end(), false));
  return result;
}

}  // namespace invar::metrology
