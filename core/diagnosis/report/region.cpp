#include "core/diagnosis/report/region.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/quantity.hpp"
#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/report/course.hpp"
#include "core/diagnosis/report/report.hpp"

namespace invar::diagnosis {

namespace {

constexpr std::size_t cells = 40, fewest = 3;  // fewest: rows in a cell that counts
constexpr double third = 1.0 / 3.0;

/// By recording and row, the square of what the finding does to the outputs, each in its noise.
std::vector<std::vector<double>> power_of_effect(const Case& data, const Diagnosis& d, std::size_t finding) {
  const auto with = simulate(data, d.best.model);
  const auto without = simulate(data, physics::without_term(d.best.model, data.model.terms.size() + finding));
  std::vector<std::vector<double>> power;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto& squares = power.emplace_back(data.recordings[r].inputs.rows(), 0.0);
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const double noise = d.heldout[o].noise_floor > 0.0 ? d.heldout[o].noise_floor : 1.0;
      for (std::size_t i = 0; i < squares.size(); ++i)
        if (const double does = (with[r][o][i] - without[r][o][i]) / noise; std::isfinite(does))
          squares[i] += does * does;
    }
  }
  return power;
}

/// From the first to the last cell whose weight is more than a third of the greatest; nothing where the variable stands
/// still or is not recorded.
std::optional<Region> region_over(const Case& data, const std::string& variable,
                                  std::vector<std::vector<double>> values,
                                  const std::vector<std::vector<double>>& power) {
  Region region{variable, unit_of_variable(data, variable), {}, false};
  double low = 1e300, high = -1e300;
  for (std::size_t r = 0; r < values.size(); ++r) {
    values[r].resize(power[r].size(), std::nan(""));
    for (const double v : values[r])
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  }
  if (!(high > low)) return std::nullopt;
  std::vector<double> sum(cells, 0.0), count(cells, 0.0);
  for (std::size_t r = 0; r < values.size(); ++r)
    for (std::size_t i = 0; i < values[r].size(); ++i) {
      if (!std::isfinite(values[r][i]) || !std::isfinite(power[r][i])) continue;
      const auto cell = std::min(cells - 1, static_cast<std::size_t>((values[r][i] - low) / (high - low) *
                                                                     static_cast<double>(cells)));
      sum[cell] += power[r][i], count[cell] += 1.0;
    }
  double top = 0.0;
  for (std::size_t c = 0; c < cells; ++c) {
    sum[c] = count[c] < static_cast<double>(fewest) ? 0.0 : std::sqrt(sum[c] / count[c]);
    top = std::max(top, sum[c]);
  }
  std::size_t first = cells, last = 0;
  for (std::size_t c = 0; c < cells; ++c)
    if (sum[c] > third * top) first = std::min(first, c), last = c;
  if (first > last) return std::nullopt;
  const double width = (high - low) / static_cast<double>(cells);
  region.within = {low + width * static_cast<double>(first), low + width * static_cast<double>(last + 1)};
  region.is_part = last + 1 - first < cells * 7 / 10;
  return region;
}

Region region_of_curve(const Case& data, const physics::Curve& curve) {
  double top = 0.0;
  for (const double v : curve.values) top = std::max(top, std::abs(v));
  Region region{
      curve.over, unit_of_variable(data, curve.over), {curve.knots.front(), curve.knots.front()}, false};
  bool any = false;
  if (curve.period > 0.0) return region;                            // everywhere
  if (curve.memory != physics::Curve::Memory::none) return region;  // its knots are no places
  for (std::size_t k = 0; k < curve.knots.size(); ++k)
    if (std::abs(curve.values[k]) > third * top) {
      region.within = {any ? region.within.lower : curve.knots[k], curve.knots[k]};
      any = true;
    }
  const double width = curve.knots.back() - curve.knots.front();
  region.is_part = any && region.within.upper - region.within.lower < 0.7 * width;
  return region;
}

}  // namespace

std::vector<Region> regions_of(const Case& data, const Diagnosis& d, std::size_t finding) {
  const auto& term = d.findings[finding].term;
  if (!term.curve.knots.empty()) return {region_of_curve(data, term.curve)};
  if (data.model.plant == physics::Plant::thermal || data.model.plant == physics::Plant::equations) {
    // There an effect goes on long after its cause: what the term does says where it acts.
    const auto course = course_of(data, d, term);
    if (course.values.empty()) return {};
    auto region = region_over(data, course.variable, course.values, course.power);
    return region ? std::vector<Region>{*region} : std::vector<Region>{};
  }
  const auto power = power_of_effect(data, d, finding);
  std::vector<Region> regions;
  for (const auto& variable : dependence(data, d.findings[finding])) {
    std::vector<std::vector<double>> values;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      values.push_back(variable_values(data, r, variable));
    if (auto region = region_over(data, variable, std::move(values), power))
      regions.push_back(std::move(*region));
  }
  return regions;
}

std::string where_of(const Case& data, const Diagnosis& d, std::size_t finding) {
  std::string text;
  for (const auto& region : regions_of(data, d, finding))
    if (region.is_part)
      text += (text.empty() ? ", most at " : ", ") + region.variable + " " +
              si(region.within.lower, region.unit) + " to " + si(region.within.upper, region.unit);
  return place_of(data, d.findings[finding].term) + text;
}

}  // namespace invar::diagnosis
