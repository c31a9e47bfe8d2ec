// Which pitch or frequency would explain most of an axis's residual, carried back to the force or the reading that would
// have caused it: that is looked at along position and time.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "tools/diagnose/axis_modes.hpp"
#include "tools/diagnose/candidates.hpp"
#include "tools/diagnose/carried_back.hpp"

namespace invar::diagnose {

namespace {

std::vector<double> power_of(const Spectrum& spectrum, std::size_t bins) {
  std::vector<double> power(bins);
  for (std::size_t k = 0; k < bins; ++k) power[k] = std::norm(spectrum[k]);
  return power;
}

/// The level of a power spectrum about each bin of from..to - 1, whatever peaks stand there.
std::vector<double> levels(const std::vector<double>& power, std::size_t from, std::size_t to) {
  std::vector<double> level(power.size(), 0.0);
  for (std::size_t block = from; block < to;) {
    const std::size_t half = std::max<std::size_t>(12, block / 4);
    const std::size_t a = block > half + from ? block - half : from, b = std::min(to, block + half);
    const double local = median(
        {power.begin() + static_cast<std::ptrdiff_t>(a), power.begin() + static_cast<std::ptrdiff_t>(b)});
    const std::size_t until = std::min(to, block + std::max<std::size_t>(1, half / 4));
    for (; block < until; ++block) level[block] = local;
  }
  return level;
}

/// Peaks of a power spectrum that stand out of their neighbourhood, best first; bins below `from` are left out.
std::vector<double> peaks(const std::vector<double>& power, std::size_t from, std::size_t to,
                          std::size_t most) {
  std::vector<std::pair<double, double>> found;
  to = std::min(to, power.size() - 1);
  const auto level = levels(power, from, to);
  for (std::size_t k = std::max<std::size_t>(1, from); k + 1 < to; ++k)
    if (power[k] > power[k - 1] && power[k] >= power[k + 1] && level[k] > 0.0) {
      // The top of the parabola through three bins.
      const double bend = power[k - 1] - 2.0 * power[k] + power[k + 1];
      const double shift = bend < 0.0 ? 0.5 * (power[k - 1] - power[k + 1]) / bend : 0.0;
      found.emplace_back(power[k] / level[k], static_cast<double>(k) + shift);
    }
  std::sort(found.rbegin(), found.rend());
  std::vector<double> places;
  for (const auto& [height, place] : found) {
    if (places.size() >= most || height < 6.0) break;
    places.push_back(place);
  }
  return places;
}

/// The spectrum of a series that waves for long, its bin `place` between the whole ones.
Complex between(const Spectrum& spectrum, double place) {
  const auto k = static_cast<std::size_t>(place);
  const Complex a = spectrum[k], b = spectrum[k + 1];
  if (!(std::abs(a) > 0.0) || !(std::abs(b) > 0.0)) return a;
  // Neighbours of a padded spectrum turn against each other: sizes and turns are interpolated apart.
  const double share = place - std::floor(place), turn = std::arg(b / a);
  return std::polar((1.0 - share) * std::abs(a) + share * std::abs(b), std::arg(a) + share * turn);
}

struct Square {
  double place = 0.0, phase = 0.0, gain = 0.0;  // bin, phase where the spectrum begins [rad]
};

/// The square wave about `place` that would explain most. Its odd waves count together, each with its size and phase and by
/// the noise where it stands: in a closed loop the higher ones may stand out more than the first. `answer`: the power of
/// the answer to a push, bin by bin.
Square square_at(const Spectrum& spectrum, const std::vector<double>& answer,
                 const std::vector<double>& level, double place) {
  constexpr int waves = 8, phases = 128;
  const auto top = static_cast<double>(level.size() - 2);
  double expected = 0.0;
  std::array<Complex, waves> part{};
  for (int wave = 0; wave < waves; ++wave) {
    const double order = 2.0 * wave + 1.0, bin = order * place;
    if (bin >= top) break;
    const auto k = static_cast<std::size_t>(bin);
    const double worth = level[k] > 0.0 ? answer[k] / level[k] : 0.0;
    part[static_cast<std::size_t>(wave)] = between(spectrum, bin) * worth * Complex{0.0, 1.0} / order;
    expected += answer[k] * worth / (order * order);
  }
  Square best{place, 0.0, 0.0};
  for (int i = 0; i < phases && expected > 0.0; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / phases;
    const Complex back = std::polar(1.0, -phase), twice = back * back;
    Complex turn = back;
    double sum = 0.0;
    for (const auto& one : part) sum += (one * turn).real(), turn *= twice;
    if (const double gain = sum > 0.0 ? sum * sum / expected : 0.0; gain > best.gain)
      best.gain = gain, best.phase = phase;
  }
  return best;
}

/// Square waves of which a line of the spectrum may be the first, third, fifth or seventh wave, best first.
std::vector<Square> squares(const Spectrum& spectrum, const std::vector<double>& answer,
                            const std::vector<double>& level, const std::vector<double>& lines) {
  std::vector<Square> found;
  for (const double line : lines)
    for (const double order : {1.0, 3.0, 5.0, 7.0}) {
      if (line / order < 8.0) break;
      Square best;
      for (double off = -0.4; off < 0.41; off += 0.05)
        if (const auto one = square_at(spectrum, answer, level, line / order + off); one.gain > best.gain)
          best = one;
      const auto same = std::find_if(found.begin(), found.end(),
                                     [&](const Square& s) { return std::abs(s.place - best.place) < 2.0; });
      if (same == found.end())
        found.push_back(best);
      else if (best.gain > same->gain)
        *same = best;
    }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.gain > b.gain; });
  if (found.size() > 2) found.resize(2);
  return found;
}

}  // namespace

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
    gain[k] = slope.dot(normal.ldlt().solve(slope)) - level * level / all;
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

Lines lines_of(const std::vector<double>& time, std::vector<double> force,
               const std::vector<std::vector<double>>& responses) {
  Lines found;
  const std::size_t rows = force.size(), size = power_of_two(4 * rows);
  const double period = (time.back() - time.front()) / static_cast<double>(rows - 1);
  // Tapered: what a strong line leaks must not be the level that others, or itself, are held against.
  for (std::size_t i = 0; i < rows; ++i)
    force[i] *=
        1.0 - std::cos(2.0 * std::numbers::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(rows));
  const auto spectrum = transform(std::move(force), size);
  const auto power = power_of(spectrum, size / 2);
  const double hertz = 1.0 / (static_cast<double>(size) * period);
  const auto lines = peaks(power, 8, power.size(), 6);
  for (std::size_t k = 0; k < std::min<std::size_t>(3, lines.size()); ++k)
    found.frequency.push_back(lines[k] * hertz);
  const auto answer = answer_power(responses, size);
  // A slow wave is hardly narrower than its neighbourhood, and where a loop holds against it no peak stands out: the
  // frequency of the greatest likelihood stays as well.
  const double cycle = static_cast<double>(size) / static_cast<double>(rows);  // bins of one in the recording
  double likeliest = 0.0, place = 0.0;
  for (auto k = static_cast<std::size_t>(2.0 * cycle); k < power.size(); ++k)
    if (answer[k] > 0.0 && power[k] > likeliest * answer[k])
      likeliest = power[k] / answer[k], place = static_cast<double>(k);
  if (place > 0.0 &&
      std::none_of(lines.begin(), lines.begin() + std::min<std::ptrdiff_t>(3, std::ssize(lines)),
                   [&](double line) { return std::abs(line - place) < 0.5 * cycle; }))
    found.frequency.push_back(place * hertz);
  for (const auto& square : squares(spectrum, answer, levels(power, 8, power.size() - 1), lines)) {
    const double turns = square.place * hertz * time.front();
    found.squares.emplace_back(
        square.place * hertz,
        std::remainder(square.phase - 2.0 * std::numbers::pi * turns, 2.0 * std::numbers::pi));
  }
  return found;
}

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

}  // namespace invar::diagnose
