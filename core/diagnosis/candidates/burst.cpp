#include "core/diagnosis/candidates/burst.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/diagnosis/dataset/statistics.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

struct Burst {
  double loud = 0.0;  // its power against the usual
  double from = 0.0, to = 0.0;
};

/// The loudest stretch of a residual, with a quiet block on either side.
std::optional<Burst> burst_in(const std::vector<double>& time, const std::vector<double>& left) {
  constexpr double louder = 4.0, still_loud = 2.0, most = 1.0 / 3.0;
  constexpr std::size_t blocks = 60, least = 16;  // rows of a block
  const std::size_t rows = std::max(least, left.size() / blocks), count = left.size() / rows;
  if (count < 10) return std::nullopt;
  std::vector<double> power(count, 0.0);
  for (std::size_t b = 0; b < count; ++b) {
    double n = 0.0;
    for (std::size_t i = b * rows; i < (b + 1) * rows; ++i)
      if (std::isfinite(left[i])) power[b] += left[i] * left[i], n += 1.0;
    power[b] /= std::max(1.0, n);
  }
  const double usual = median(power);
  const auto loudest = static_cast<std::size_t>(std::max_element(power.begin(), power.end()) - power.begin());
  if (!(usual > 0.0) || power[loudest] < louder * usual) return std::nullopt;
  std::size_t first = loudest, last = loudest;
  while (first > 0 && power[first - 1] > still_loud * usual) --first;
  while (last + 1 < count && power[last + 1] > still_loud * usual) ++last;
  if (static_cast<double>(last - first + 1) > most * static_cast<double>(count)) return std::nullopt;
  return Burst{power[loudest] / usual, time[(first > 0 ? first - 1 : 0) * rows],
               time[std::min(left.size(), (last + 2) * rows) - 1]};
}

}  // namespace

std::vector<Start> burst_starts(const Case& data, const Fit& fitted) {
  if (data.model.plant != physics::Plant::axis) return {};
  const auto simulated = simulate(data, fitted.model);
  Burst burst;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      auto left = data.recordings[r].measured[o];
      for (std::size_t i = 0; i < left.size(); ++i) left[i] -= simulated[r][o][i];
      if (const auto found = burst_in(data.recordings[r].inputs.time, left);
          found && found->loud > burst.loud)
        burst = *found;
    }
  if (!(burst.to > burst.from)) return {};
  Start start;
  start.term.info = physics::unmodelled(data.model.plant, "force");
  start.term.curve.over = "time";
  constexpr std::size_t knots = 18;
  for (std::size_t k = 0; k < knots; ++k) {
    start.term.curve.knots.push_back(burst.from + (burst.to - burst.from) * static_cast<double>(k) /
                                                      static_cast<double>(knots - 1));
    start.term.curve.values.push_back(0.0);
    // Before and behind it there is nothing.
    if (k > 0 && k + 1 < knots) start.directions.push_back({physics::most_parameters, k, false});
  }
  return {std::move(start)};
}

}  // namespace invar::diagnosis
