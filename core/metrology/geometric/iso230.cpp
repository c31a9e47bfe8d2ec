#include "core/metrology/geometric/iso230.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace invar::metrology {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr double coverage = 2.0;  // k of an expanded uncertainty, and of s in the standard's figures
constexpr int draws = 400;        // of readings: an uncertainty to 4 %

double mean_of(const std::vector<double>& values) {
  if (values.empty()) return unknown;
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double deviation_of(const std::vector<double>& values, double mean) {
  if (values.size() < 2) return unknown;
  double sum = 0.0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

TargetFigures figures_of(const TargetReadings& readings) {
  TargetFigures result;
  result.position = readings.position;
  result.mean_forward = mean_of(readings.forward);
  result.mean_backward = mean_of(readings.backward);
  result.mean = 0.5 * (result.mean_forward + result.mean_backward);
  result.reversal = result.mean_forward - result.mean_backward;
  result.s_forward = deviation_of(readings.forward, result.mean_forward);
  result.s_backward = deviation_of(readings.backward, result.mean_backward);
  result.repeatability_forward = 2.0 * coverage * result.s_forward;
  result.repeatability_backward = 2.0 * coverage * result.s_backward;
  const double both = coverage * (result.s_forward + result.s_backward) + std::abs(result.reversal);
  result.repeatability = std::isnan(both)
                             ? unknown
                             : std::max({both, result.repeatability_forward, result.repeatability_backward});
  return result;
}

/// Largest less smallest of what two functions give at the targets; NaN where one is missing.
template <class Above, class Below>
double span(const std::vector<TargetFigures>& targets, Above above, Below below) {
  double highest = -std::numeric_limits<double>::infinity();
  double lowest = -highest;
  for (const TargetFigures& one : targets) {
    if (std::isnan(above(one)) || std::isnan(below(one))) return unknown;
    highest = std::max(highest, above(one));
    lowest = std::min(lowest, below(one));
  }
  return highest - lowest;
}

template <class Value>
double largest(const std::vector<TargetFigures>& targets, Value value) {
  double result = 0.0;
  for (const TargetFigures& one : targets) {
    if (std::isnan(value(one))) return unknown;
    result = std::max(result, value(one));
  }
  return result;
}

std::array<double, iso230_figures> axis_figures(const std::vector<TargetFigures>& targets) {
  const auto forward = [](const TargetFigures& t) { return t.mean_forward; };
  const auto backward = [](const TargetFigures& t) { return t.mean_backward; };
  const auto upper_f = [](const TargetFigures& t) { return t.mean_forward + coverage * t.s_forward; };
  const auto lower_f = [](const TargetFigures& t) { return t.mean_forward - coverage * t.s_forward; };
  const auto upper_b = [](const TargetFigures& t) { return t.mean_backward + coverage * t.s_backward; };
  const auto lower_b = [](const TargetFigures& t) { return t.mean_backward - coverage * t.s_backward; };
  const auto mean = [](const TargetFigures& t) { return t.mean; };
  const auto higher = [](double a, double b) {
    return std::isnan(a) || std::isnan(b) ? unknown : std::max(a, b);
  };
  const auto lower = [](double a, double b) {
    return std::isnan(a) || std::isnan(b) ? unknown : std::min(a, b);
  };
  double reversal = 0.0;
  for (const TargetFigures& one : targets) reversal += one.reversal / static_cast<double>(targets.size());
  return {largest(targets, [](const TargetFigures& t) { return std::abs(t.reversal); }),
          reversal,
          largest(targets, [](const TargetFigures& t) { return t.repeatability_forward; }),
          largest(targets, [](const TargetFigures& t) { return t.repeatability_backward; }),
          largest(targets, [](const TargetFigures& t) { return t.repeatability; }),
          span(targets, forward, forward),
          span(targets, backward, backward),
          span(
              targets, [&](const TargetFigures& t) { return higher(t.mean_forward, t.mean_backward); },
              [&](const TargetFigures& t) { return lower(t.mean_forward, t.mean_backward); }),
          span(targets, mean, mean),
          span(targets, upper_f, lower_f),
          span(targets, upper_b, lower_b),
          span(
              targets, [&](const TargetFigures& t) { return higher(upper_f(t), upper_b(t)); },
              [&](const TargetFigures& t) { return lower(lower_f(t), lower_b(t)); })};
}

std::vector<TargetFigures> figures_of(const std::vector<TargetReadings>& readings) {
  std::vector<TargetFigures> targets;
  targets.reserve(readings.size());
  for (const TargetReadings& one : readings) targets.push_back(figures_of(one));
  return targets;
}

/// Spread of the figures over readings drawn again.
std::array<double, iso230_figures> chance_of(const std::vector<TargetReadings>& readings,
                                             const Iso230& found) {
  std::mt19937_64 random{230};
  std::normal_distribution<double> normal;
  std::array<double, iso230_figures> sum{};
  std::array<double, iso230_figures> square{};
  for (int d = 0; d < draws; ++d) {
    std::vector<TargetReadings> drawn = readings;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const TargetFigures& one = found.targets[i];
      for (double& value : drawn[i].forward) value = one.mean_forward + one.s_forward * normal(random);
      for (double& value : drawn[i].backward) value = one.mean_backward + one.s_backward * normal(random);
    }
    const auto values = axis_figures(figures_of(drawn));
    for (std::size_t f = 0; f < iso230_figures; ++f) {
      sum[f] += values[f] / draws;
      square[f] += values[f] * values[f] / draws;
    }
  }
  std::array<double, iso230_figures> result{};
  for (std::size_t f = 0; f < iso230_figures; ++f)
    result[f] =
        std::sqrt(std::max(square[f] - sum[f] * sum[f], 0.0)) * (std::isnan(square[f]) ? unknown : 1.0);
  return result;
}

}  // namespace

Iso230 iso230(const std::vector<TargetReadings>& readings, const Iso230Conditions& conditions) {
  Iso230 result;
  result.targets = figures_of(readings);
  result.values = axis_figures(result.targets);
  const auto chance = chance_of(readings, result);
  const double length =
      readings.empty() ? 0.0 : std::abs(readings.back().position - readings.front().position);
  for (std::size_t f = 0; f < iso230_figures; ++f) {
    // A scale error stretches what is compared over the length; it leaves reversal and repeatability as they are.
    const bool over_length = f >= static_cast<std::size_t>(Iso230Figure::E_forward);
    const double scale = over_length ? conditions.device * length : 0.0;
    result.uncertainty[f] = coverage * std::sqrt(chance[f] * chance[f] + scale * scale +
                                                 conditions.environment * conditions.environment);
  }
  return result;
}

}  // namespace invar::metrology
