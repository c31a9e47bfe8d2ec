#include "core/diagnosis/locate/axis_periods.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/locate/axis_modes.hpp"
#include "core/diagnosis/locate/carried_back.hpp"
#include "core/diagnosis/locate/lines.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::diagnosis {

// Where a carriage stood says no more of a wave than where it passed, though it left many rows there.
std::vector<double> long_pitches(const std::vector<double>& sums, const std::vector<double>& weights,
                                 double span) {
  constexpr std::size_t cells = 1024;
  constexpr double step = 0.1;  // waves over the span
  std::array<double, cells> sum{}, weight{};
  for (std::size_t i = 0; i < sums.size(); ++i)
    sum[i * cells / sums.size()] += sums[i], weight[i * cells / sums.size()] += weights[i];
  double level = 0.0, all = 0.0;
  for (std::size_t i = 0; i < cells; ++i) level += sum[i], all += weight[i];
  std::vector<double> gain(1001, 0.0), pitches;
  for (std::size_t k = 8; k < gain.size() && all > 0.0; ++k) {
    const double turn = 2.0 * std::numbers::pi * step * static_cast<double>(k) / static_cast<double>(cells);
    const std::complex<double> next = std::polar(1.0, turn);
    std::complex<double> wave = std::polar(1.0, 0.5 * turn), mean, right;
    double cc = 0.0, cs = 0.0, ss = 0.0;
    for (std::size_t i = 0; i < cells; ++i, wave *= next) {
      if (weight[i] == 0.0) continue;
      const double c = wave.real(), s = wave.imag(), w = weight[i];
      mean += w * wave, right += sum[i] * wave;
      cc += w * c * c, cs += w * c * s, ss += w * s * s;
    }
    Eigen::Matrix3d normal;
    normal << all, mean.real(), mean.imag(), mean.real(), cc, cs, mean.imag(), cs, ss;
    normal.diagonal().array() += 1e-12 * all;
    const Eigen::Vector3d slope{level, right.real(), right.imag()};
    gain[k] = slope.dot(numerics::solve_symmetric(normal, slope)) - level * level / all;
  }
  std::vector<std::pair<double, double>> tops;
  for (std::size_t k = 9; k + 1 < gain.size(); ++k)
    if (gain[k] > gain[k - 1] && gain[k] >= gain[k + 1]) {
      const double bend = gain[k - 1] - 2.0 * gain[k] + gain[k + 1];
      tops.emplace_back(gain[k], static_cast<double>(k) + 0.5 * (gain[k - 1] - gain[k + 1]) / bend);
    }
  std::sort(tops.rbegin(), tops.rend());
  for (std::size_t i = 0; i < std::min<std::size_t>(4, tops.size()); ++i)
    pitches.push_back(span / (step * tops[i].second));
  return pitches;
}

std::vector<double> sensor_pitches(const Case& data, const Fit& fitted) {
  std::vector<std::vector<double>> positions;
  double low = 1e300, high = -1e300;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    positions.push_back(variable_values(data, r, "true_position"));
    for (double x : positions.back()) low = std::min(low, x), high = std::max(high, x);
  }
  const double span = high - low;
  if (!(span > 1e-6)) return {};
  constexpr std::size_t bins = 1U << 16U, padded = 4 * bins;
  std::vector<double> grid(bins, 0.0), count(bins, 0.0);
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < positions.size(); ++r)
    for (const auto& output : data.outputs) {
      for (std::size_t i = 0; i < positions[r].size(); ++i, ++at)
        if (output == "encoder") {
          const auto bin = static_cast<std::size_t>((positions[r][i] - low) / span * (bins - 1));
          grid[bin] += fitted.residual(at), count[bin] += 1.0;
        }
    }
  const auto slow = long_pitches(grid, count, span);
  const auto spectrum = transform(std::move(grid), padded);
  const auto power = power_of(spectrum, bins);
  std::vector<double> pitches;
  for (double k :
       peaks(power, 4, std::min<std::size_t>(bins - 2, static_cast<std::size_t>(4.0 * span / 1e-5)), 6))
    pitches.push_back(4.0 * span / k);
  pitches.insert(pitches.end(), slow.begin(), slow.end());
  return pitches;
}

namespace {

/// Pitches of what goes with the place, `weights[r][i]` at `positions[r][i]`.
std::vector<double> pitches_along(const std::vector<std::vector<double>>& positions,
                                  const std::vector<std::vector<double>>& weights, double low, double span,
                                  double least) {
  constexpr std::size_t bins = 1U << 15U, padded = 4 * bins;
  std::vector<double> grid(bins, 0.0);
  for (std::size_t r = 0; r < positions.size(); ++r)
    for (std::size_t i = 0; i < positions[r].size(); ++i) {
      const auto bin = static_cast<std::size_t>((positions[r][i] - low) / span * (bins - 1));
      grid[std::min(bin, bins - 1)] += weights[r][i];
    }
  const auto spectrum = transform(std::move(grid), padded);
  const auto power = power_of(spectrum, bins);
  std::vector<double> pitches;
  // Bin k is k/4 periods over the travel; finer than a 400th of it or 20 um is no pitch.
  const double finest = std::max(least, span / 6000.0);
  const auto last = std::min(bins - 1, static_cast<std::size_t>(4.0 * span / finest));
  for (double k : peaks(power, 4, last, 4)) pitches.push_back(4.0 * span / k);
  // A carriage that is pushed at a few places alone smears a wave over its neighbours: the highest of all stays.
  if (last > 4) {
    const auto highest =
        std::max_element(power.begin() + 4, power.begin() + static_cast<std::ptrdiff_t>(last));
    const double pitch = 4.0 * span / static_cast<double>(highest - power.begin());
    if (std::none_of(pitches.begin(), pitches.end(),
                     [&](double p) { return std::abs(span / p - span / pitch) < 0.5; }))
      pitches.push_back(pitch);
  }
  return pitches;
}

}  // namespace

namespace {

/// Jobs that do not wait for each other.
void at_once(const std::vector<std::function<void()>>& jobs) {
  in_parallel(jobs.size(), [&](std::size_t k) { jobs[k](); });
}

}  // namespace

Periods axis_periods(const Case& data, const Weighing& weighing, const Fit& fitted) {
  std::vector<std::vector<double>> force, reading;  // answers to a pulse of each
  at_once({[&] { force = pulse_responses(data, weighing, fitted.model, "force", 1e-2); },
           [&] { reading = pulse_responses(data, weighing, fitted.model, "measurement", 1e-7); }});
  const std::size_t recordings = data.recordings.size();
  std::vector<std::vector<double>> positions(recordings), forces(recordings), readings(recordings),
      motors(recordings);  // forces times currents
  in_parallel(2 * recordings, [&](std::size_t k) {
    const std::size_t r = k / 2;
    (k % 2 == 0 ? forces : readings)[r] = carried_back(data, fitted, k % 2 == 0 ? force : reading, r);
  });
  double low = 1e300, high = -1e300;
  for (std::size_t r = 0; r < recordings; ++r) {
    positions[r] = variable_values(data, r, "position");
    const auto current = variable_values(data, r, "current");
    for (double x : positions[r]) low = std::min(low, x), high = std::max(high, x);
    for (std::size_t i = 0; i < forces[r].size(); ++i) motors[r].push_back(forces[r][i] * current[i]);
  }
  Periods periods;
  std::vector<Lines> lines(recordings);
  std::vector<std::function<void()>> jobs{
      [&] { periods.mode_frequency = mode_frequencies(data, fitted, force, forces); }};
  for (std::size_t r = 0; r < recordings; ++r)
    jobs.emplace_back([&, r] { lines[r] = lines_of(data.recordings[r].inputs.time, forces[r], force); });
  const double span = high - low;
  if (span > 1e-5) {
    const double shortest =
        std::min(1e-3, 0.03 * span);  // of what pushes: magnets and balls of a small axis are small
    const auto along = [&](std::vector<double>& pitches, const auto& weights, double least) {
      jobs.emplace_back([&, least] { pitches = pitches_along(positions, weights, low, span, least); });
    };
    along(periods.force_pitch, forces, shortest);
    along(periods.motor_pitch, motors, shortest);
    along(periods.reading_pitch, readings, 2e-5);
  }
  at_once(jobs);
  const auto also = [](std::vector<double>& pitches, const std::vector<double>& others) {
    pitches.insert(pitches.end(), others.begin(),
                   others.begin() + std::min<std::ptrdiff_t>(2, std::ssize(others)));
  };
  // A loop follows what its encoder reads wrong: of a coarse pitch the force shows more than the reading.
  also(periods.reading_pitch, periods.force_pitch);
  // The two ripples look alike in this light; each is also tried at the other's pitch.
  also(periods.force_pitch, periods.motor_pitch);
  also(periods.motor_pitch, periods.force_pitch);
  for (const auto& one : lines) {
    periods.force_frequency.insert(periods.force_frequency.end(), one.frequency.begin(), one.frequency.end());
    periods.squares.insert(periods.squares.end(), one.squares.begin(), one.squares.end());
  }
  return periods;
}

}  // namespace invar::diagnosis
