#include "core/diagnosis/dataset/outliers.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/dataset/variables.hpp"

namespace invar::diagnosis {

namespace {

/// Each value less the median of its neighbours to this reach.
std::vector<double> off_median(const std::vector<double>& values, std::size_t reach) {
  std::vector<double> off(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t a = i < reach ? 0 : i - reach, b = std::min(values.size(), i + reach + 1);
    off[i] = values[i] - median({values.begin() + static_cast<std::ptrdiff_t>(a),
                                 values.begin() + static_cast<std::ptrdiff_t>(b)});
  }
  return off;
}

/// Each value less the median of the middles of the three pairs of neighbours about it.
std::vector<double> off_lines(const std::vector<double>& values) {
  std::vector<double> off(values.size(), 0.0);
  for (std::size_t i = 3; i + 3 < values.size(); ++i) {
    const auto middle = [&](std::size_t by) { return 0.5 * (values[i - by] + values[i + by]); };
    off[i] = values[i] - median({middle(1), middle(2), middle(3)});
  }
  return off;
}

/// How far values usually lie off the median of their neighbours. In a stretch that rises all the way each value is that
/// median itself: where most do, noise in the other stretches would stand out. The lines through the neighbours know it.
double scale_of(const std::vector<double>& off, const std::vector<double>& values, bool is_time_series) {
  constexpr double of_lines = 0.74;  // 0.81 over 1.10, the two scales of white noise
  const double scale = robust_sigma(off);
  return is_time_series && scale > 0.0 ? std::max(scale, of_lines * robust_sigma(off_lines(values))) : scale;
}

/// By row, what one count of the converter is about its reading; 0 where readings are not in counts. Each converter has a
/// finest step, of which all readings are multiples. One that is bent afterwards (a thermistor's) has steps that change
/// along its range: there the steps between the values nearest to a reading count, where most values were read again.
std::vector<double> counts_of(const std::vector<double>& values) {
  constexpr double of_rounding = 1e-9;  // of the range: two roundings of one number
  std::vector<double> levels = values;
  std::sort(levels.begin(), levels.end());
  const double same = of_rounding * (levels.back() - levels.front());
  levels.erase(std::unique(levels.begin(), levels.end(), [&](double a, double b) { return b - a <= same; }),
               levels.end());
  if (levels.size() < 3) return std::vector<double>(values.size(), 0.0);
  std::vector<double> steps;
  for (std::size_t k = 1; k < levels.size(); ++k) steps.push_back(levels[k] - levels[k - 1]);
  const double finest = *std::min_element(steps.begin(), steps.end());
  constexpr double of_a_step = 1e-3;  // how near a whole number of steps is
  const bool even = std::all_of(steps.begin(), steps.end(), [&](double step) {
    return std::abs(step / finest - std::round(step / finest)) < of_a_step * std::max(1.0, step / finest);
  });
  if (even || 2 * levels.size() > values.size())
    return std::vector<double>(values.size(), even ? finest : 0.0);
  constexpr std::size_t reach = 5;  // steps to each side: a slip far from all others does not make its own
  std::vector<double> counts;
  for (const double value : values) {
    const auto at = static_cast<std::size_t>(std::lower_bound(levels.begin(), levels.end(), value - same) -
                                             levels.begin());
    const std::size_t a = at < reach ? 0 : at - reach, b = std::min(steps.size(), at + reach);
    counts.push_back(median(
        {steps.begin() + static_cast<std::ptrdiff_t>(a), steps.begin() + static_cast<std::ptrdiff_t>(b)}));
  }
  return counts;
}

enum class Order { in_time, none };

/// Which are alone far from zero; nothing where most are zero. A step of two counts, and half of one for the rounding of what
/// it is compared with, is how a converter reads: `counts` by row.
std::optional<std::vector<std::size_t>> far_from(const std::vector<double>& off, double scale, Order order,
                                                 const std::vector<double>& counts) {
  const bool is_time_series = order == Order::in_time;
  if (!(scale > 0.0)) return std::nullopt;
  constexpr double read_alike = 2.5;  // counts
  const double limit = (is_time_series ? 6.0 : 5.0) * scale;
  // A neighbour that is off to the same side, and not by next to nothing against it, makes it a narrow effect and no
  // lone value.
  const auto beside = [&](std::size_t i, std::size_t j) {
    return is_time_series && j < off.size() &&
           off[j] * std::copysign(1.0, off[i]) > std::max(0.5 * limit, 0.2 * std::abs(off[i]));
  };
  const auto is_far = [&](std::size_t i) {
    return std::abs(off[i]) > std::max(limit, read_alike * counts[i]);
  };
  std::vector<std::size_t> lone;
  for (std::size_t i = 0; i < off.size(); ++i)
    if (is_far(i) && !beside(i, i - 1) && !beside(i, i + 1)) lone.push_back(i);
  // Where many are alone, some fall beside another by chance; no more of them than that.
  std::vector<std::size_t> pairs;
  for (std::size_t i = 1; i + 2 < off.size(); ++i)
    if (is_far(i) && is_far(i + 1) && beside(i, i + 1) && !beside(i, i - 1) && !beside(i + 1, i + 2))
      pairs.push_back(i);
  const auto alone = static_cast<double>(lone.size());
  const double expected = 0.5 * alone * alone / static_cast<double>(off.size());
  if (expected > 0.02 && static_cast<double>(pairs.size()) < expected + 1.0 + 4.0 * std::sqrt(expected))
    for (const std::size_t i : pairs) lone.push_back(i), lone.push_back(i + 1);
  return lone;
}

bool is_static(physics::Plant plant) {
  return plant == physics::Plant::error_map || plant == physics::Plant::droplet ||
         plant == physics::Plant::sensor;
}

/// Does the value go on as the four before it, or those behind it, which lie on a straight line themselves? The last of a
/// sweep does, however far the next begins.
bool goes_on(const std::vector<double>& values, std::size_t i, double scale, double within) {
  for (const int side : {-1, 1}) {
    const auto at = [&](int k) { return static_cast<std::ptrdiff_t>(i) + side * k; };
    if (at(4) < 0 || at(4) >= static_cast<std::ptrdiff_t>(values.size())) continue;
    const auto value = [&](int k) { return values[static_cast<std::size_t>(at(k))]; };
    double mean = 0.0, slope = 0.0;
    for (int k = 1; k <= 4; ++k) mean += 0.25 * value(k), slope += (k - 2.5) / 5.0 * value(k);
    const auto apart = [&](int k) { return std::abs(value(k) - mean - slope * (k - 2.5)); };
    if (apart(0) < within && std::max({apart(1), apart(2), apart(3), apart(4)}) < 3.0 * scale) return true;
  }
  return false;
}

void forget_continued(std::vector<std::size_t>& lone, const std::vector<double>& values,
                      const std::vector<double>& off) {
  const double scale = robust_sigma(off);
  std::erase_if(lone, [&](std::size_t i) {
    return goes_on(values, i, scale, std::max(3.0 * scale, 0.3 * std::abs(off[i])));
  });
}

/// What is recorded of the machine where a reading was taken, at these rows. Time is not among it: an instrument may fail
/// for a while.
std::vector<std::vector<double>> recorded_at(const Case& data, std::size_t recording,
                                             const std::vector<std::size_t>& rows) {
  std::vector<std::string> names;
  for (const auto& [name, values] : data.recordings[recording].inputs.signals) names.push_back(name);
  if (data.model.plant == physics::Plant::sensor) names.insert(names.end(), {"velocity", "acceleration"});
  std::vector<std::vector<double>> all;
  for (const auto& name : names) {
    const auto values = variable_values(data, recording, name);
    if (values.empty()) continue;
    auto& some = all.emplace_back();
    for (const std::size_t row : rows) some.push_back(std::isfinite(values[row]) ? values[row] : 0.0);
  }
  return all;
}

/// Slips come anywhere. What comes together at like values of something that was recorded, oftener than chance would and to
/// one side, is an effect: those stay.
void keep_effects(std::vector<std::size_t>& lone, const std::vector<double>& off,
                  const std::vector<std::vector<double>>& recorded) {
  std::vector<int> sign(off.size(), 0);
  double up = 0.0, down = 0.0;
  for (const std::size_t i : lone) sign[i] = off[i] > 0.0 ? 1 : -1, (off[i] > 0.0 ? up : down) += 1.0;
  const double expected = (up * up + down * down) / static_cast<double>(off.size());
  std::vector<bool> stays(off.size(), false);
  for (const auto& values : recorded) {
    std::vector<std::size_t> order(off.size());
    std::iota(order.begin(), order.end(), 0);
    // Rows of one value stand in no order, for theirs would be that of time.
    const auto mixed = [](std::size_t i) { return (i * 2654435761U) % 4294967296U; };
    std::sort(order.begin(), order.end(), [&](auto a, auto b) {
      return values[a] != values[b] ? values[a] < values[b] : mixed(a) < mixed(b);
    });
    std::vector<std::size_t> together;
    double pairs = 0.0;
    for (std::size_t k = 1; k < order.size(); ++k) {
      const double one = std::abs(off[order[k - 1]]), two = std::abs(off[order[k]]);
      if (sign[order[k]] == 0 || sign[order[k]] != sign[order[k - 1]]) continue;
      pairs += 1.0;
      if (one < 3.0 * two && two < 3.0 * one) together.insert(together.end(), {order[k - 1], order[k]});
    }
    if (pairs < expected + 3.0 + 4.0 * std::sqrt(expected)) continue;
    for (const std::size_t i : together) stays[i] = true;
  }
  std::erase_if(lone, [&](std::size_t i) { return stays[i]; });
}

/// Of a residual that still holds effects: what is far beyond nine in ten.
double wider_scale(std::vector<double> off) {
  std::erase_if(off, [](double v) { return !std::isfinite(v); });
  for (double& v : off) v = std::abs(v);
  if (off.empty()) return 0.0;
  const auto at = off.begin() + static_cast<std::ptrdiff_t>(off.size() * 9 / 10);
  std::nth_element(off.begin(), at, off.end());
  return *at / 1.645;
}

/// The first or the last value, where the step to its neighbour is far longer than any other of the series: a row of another
/// run. At an end there is no neighbour on the other side to say so.
std::vector<std::size_t> ends_apart(const std::vector<double>& values) {
  constexpr double far = 5.0;  // times the longest other step
  std::vector<double> steps;
  for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(std::abs(values[i] - values[i - 1]));
  const double longest = *std::max_element(steps.begin() + 1, steps.end() - 1);
  std::vector<std::size_t> ends;
  if (steps.front() > far * longest) ends.push_back(0);
  if (steps.back() > far * longest) ends.push_back(values.size() - 1);
  return ends;
}

void drop(Case& data, std::vector<double>& measured, const std::vector<std::size_t>& rows,
          const std::vector<std::size_t>& places) {
  for (const std::size_t i : places) {
    data.count.outliers += std::isfinite(measured[rows[i]]) ? 1U : 0U;
    measured[rows[i]] = no_reading;
  }
}

}  // namespace

void drop_outliers(Case& data, const std::vector<physics::Outputs>& simulated) {
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto& recording = data.recordings[r];
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      auto& measured = recording.measured[o];
      std::vector<std::size_t> rows;
      std::vector<double> residual, read;
      for (std::size_t i = 0; i < measured.size(); ++i)
        if (std::isfinite(measured[i])) {
          rows.push_back(i);
          residual.push_back(measured[i] - simulated[r][o][i]);
          read.push_back(measured[i]);
        }
      if (residual.size() < 20) continue;
      const auto plant = data.model.plant;
      const auto order = data.is_time_series ? Order::in_time : Order::none;
      const bool is_row_by_row = is_static(plant), is_swept = is_row_by_row && data.is_time_series;
      if (!is_row_by_row) drop(data, measured, rows, ends_apart(residual));
      const auto counts = counts_of(read);
      // Against the median of its neighbourhood, on the scale of all such differences.
      auto off = off_median(residual, data.is_time_series ? 3 : 40);
      auto lone = far_from(off, scale_of(off, residual, data.is_time_series), order, counts);
      // Of a residual that runs smoothly or in coarse steps, most values are the median themselves, and next to
      // nothing is the scale: then the straight lines through the neighbours count. One row in ten is no outlier.
      const auto are_too_many = [&] { return !lone || 10 * lone->size() > residual.size(); };
      if ((are_too_many() && !is_row_by_row) || (!lone && is_swept)) {
        off = off_lines(residual);
        lone = far_from(off, robust_sigma(off), Order::in_time, counts);
        if (are_too_many() && !is_row_by_row) continue;
      }
      if (!lone) continue;
      if (is_swept) forget_continued(*lone, residual, off);
      if (are_too_many() && is_row_by_row) lone = far_from(off, wider_scale(off), order, counts);
      if (lone && is_row_by_row) keep_effects(*lone, off, recorded_at(data, r, rows));
      if (!lone) continue;
      drop(data, measured, rows, *lone);
    }
  }
}

void drop_outliers_anew(Case& data, const Case& as_read, const std::vector<physics::Outputs>& simulated) {
  // Of equations a slip is seen once the numbers are near, not while their error is louder; what was dropped stays so.
  if (data.model.plant == physics::Plant::equations) drop_outliers(data, simulated);
  if (!is_static(data.model.plant)) return;
  data.count.outliers = as_read.count.outliers;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    data.recordings[r].measured = as_read.recordings[r].measured;
  drop_outliers(data, simulated);
}

}  // namespace invar::diagnosis
