#include "tools/diagnose/loop_noise.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/physics/library.hpp"

namespace invar::diagnose {

namespace {

/// The place of the encoder among the outputs; nothing where no loop feeds its noise back.
std::optional<std::size_t> fed_back(const Case& data) {
  const auto at = std::find(data.outputs.begin(), data.outputs.end(), "position");
  if (data.model.plant != physics::Plant::axis || !data.model.controller || at == data.outputs.end())
    return std::nullopt;
  return static_cast<std::size_t>(at - data.outputs.begin());
}

/// Runs with noise on the encoder, by recording, output and row.
struct Shaken {
  std::vector<physics::Outputs> mean;    // how far they lie, on average, from the run without
  std::vector<physics::Outputs> spread;  // root mean square about that average
};

/// What a model leaves of the readings of the encoder, by recording, without those that no run can tell.
std::vector<std::vector<double>> noise_of(const LoopNoise::Readings& readings,
                                          const std::vector<physics::Outputs>& simulated,
                                          std::size_t position) {
  std::vector<std::vector<double>> noise(readings.size());
  for (std::size_t r = 0; r < readings.size(); ++r)
    for (std::size_t i = 0; i < readings[r][position].size(); ++i)
      if (const double e = readings[r][position][i] - simulated[r][position][i]; std::isfinite(e))
        noise[r].push_back(e);
  return noise;
}

/// The noise is shifted against the motion, with either sign: what is linear in it cancels in the mean.
Shaken shaken_by(const std::vector<std::vector<double>>& noise, const Case& data,
                 const physics::Model& model) {
  constexpr std::size_t shifts = 4;
  const auto quiet = simulate(data, model);
  Shaken out{quiet, quiet};
  for (std::size_t r = 0; r < quiet.size(); ++r) {
    const auto& time = data.recordings[r].inputs.time;
    const std::size_t n = time.size();
    std::vector<physics::Outputs> runs(2 * shifts);
    in_parallel(runs.size(), [&](std::size_t k) {
      if (data.stopped && data.stopped()) throw Stopped{};
      physics::Model noisy = model;
      auto& reading = noisy.terms.emplace_back();
      reading.info = physics::unmodelled(physics::Plant::axis, "measurement");
      reading.curve.over = "time";
      reading.curve.knots = time;
      const std::size_t by = (k / 2 + 1) * n / (shifts + 1);
      for (std::size_t i = 0; i < n; ++i) {
        const double e = noise[r].empty() ? 0.0 : noise[r][(i + by) % noise[r].size()];
        reading.curve.values.push_back(k % 2 == 0 ? e : -e);
      }
      data.recordings[r].simulation->run(noisy, runs[k]);
    });
    const auto count = static_cast<double>(runs.size());
    for (std::size_t o = 0; o < quiet[r].size(); ++o)
      for (std::size_t i = 0; i < n; ++i) {
        double sum = 0.0, square = 0.0;
        for (const auto& one : runs) {
          const double apart = one[o][i] - quiet[r][o][i];
          sum += apart, square += apart * apart;
        }
        out.mean[r][o][i] = sum / count;
        out.spread[r][o][i] = std::sqrt(std::max(0.0, square / count - sum * sum / count / count));
      }
  }
  return out;
}

std::vector<physics::Outputs> softened(const Case& data, const LoopNoise::Readings& recorded,
                                       const physics::Model& model, std::size_t position) {
  return shaken_by(noise_of(recorded, simulate(data, model), position), data, model).mean;
}

/// By output: the sum of squares of readings - simulated - off.
std::vector<double> squares(const LoopNoise::Readings& readings,
                            const std::vector<physics::Outputs>& simulated,
                            const std::vector<physics::Outputs>* off) {
  std::vector<double> sums(readings.front().size(), 0.0);
  for (std::size_t r = 0; r < readings.size(); ++r)
    for (std::size_t o = 0; o < sums.size(); ++o)
      for (std::size_t i = 0; i < readings[r][o].size(); ++i)
        if (const double e =
                readings[r][o][i] - simulated[r][o][i] - (off != nullptr ? (*off)[r][o][i] : 0.0);
            std::isfinite(e))
          sums[o] += e * e;
  return sums;
}

}  // namespace

LoopNoise::LoopNoise(Case& data) : data_{data} {
  for (const auto& recording : data.recordings) recorded_.push_back(recording.measured);
}

LoopNoise::Readings LoopNoise::now() const {
  Readings readings;
  for (const auto& recording : data_.recordings) readings.push_back(recording.measured);
  return readings;
}

LoopNoise::Readings LoopNoise::put_back() {
  auto was = now();
  put(recorded_);
  return was;
}

void LoopNoise::put(Readings readings) {
  for (std::size_t r = 0; r < readings.size(); ++r) data_.recordings[r].measured = std::move(readings[r]);
}

double LoopNoise::take_off(const physics::Model& model) {
  const auto position = fed_back(data_);
  if (!position) return 0.0;
  const auto simulated = simulate(data_, model);
  auto told = recorded_;
  for (std::size_t r = 0; r < told.size(); ++r)
    for (std::size_t i = 0; i < told[r][*position].size(); ++i)
      if (!std::isfinite(data_.recordings[r].measured[*position][i]))
        told[r][*position][i] = std::numeric_limits<double>::quiet_NaN();
  const auto noise = noise_of(told, simulated, *position);
  (void)put_back();
  const auto shaken = shaken_by(noise, data_, model);
  const auto& off = shaken.mean;
  const auto before = squares(recorded_, simulated, nullptr), after = squares(recorded_, simulated, &off);
  double nearer = 0.0;
  for (std::size_t o = 0; o < before.size(); ++o)
    if (before[o] > 0.0 && after[o] > 0.0) nearer += std::log(before[o] / after[o]);
  if (nearer > 0.0)
    for (std::size_t r = 0; r < off.size(); ++r)
      for (std::size_t o = 0; o < off[r].size(); ++o)
        for (std::size_t i = 0; i < off[r][o].size(); ++i) data_.recordings[r].measured[o][i] -= off[r][o][i];
  // Where the carriage sticks in one run and slips in another, no run says when it did in the recording.
  auto without = model;
  without.terms.resize(data_.model.terms.size());
  const auto linear = shaken_by(noise, data_, without).spread;
  constexpr double chance = 2.0;
  double untold = 0.0, rows = 0.0;
  constexpr std::size_t beside = 10;  // rows, so that eight runs say how far they lie apart
  for (std::size_t r = 0; r < off.size(); ++r) {
    const std::size_t n = off[r].front().size();
    for (std::size_t i = 0; i < n; ++i) {
      bool is_told = true;
      for (std::size_t o = 0; o < off[r].size(); ++o) {
        double with = 0.0, expected = 0.0;
        for (std::size_t k = i > beside ? i - beside : 0; k < std::min(n, i + beside + 1); ++k) {
          with += shaken.spread[r][o][k] * shaken.spread[r][o][k];
          expected += linear[r][o][k] * linear[r][o][k];
        }
        is_told = is_told && with <= chance * chance * expected;
      }
      ++rows, untold += is_told ? 0.0 : 1.0;
      for (auto& measured : data_.recordings[r].measured)
        if (!is_told) measured[i] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return untold / rows;
}

bool LoopNoise::shows(const physics::Model& with, const physics::Model& without, double ratio) const {
  const auto position = fed_back(data_);
  if (!position) return true;
  const auto off = softened(data_, recorded_, with, *position);
  const auto simulated = simulate(data_, with);
  // Where a shaken carriage sticks here and slips there the average says little; then what takes a fifth off without noise counts.
  constexpr double plain = 0.8;
  const auto shaken = squares(recorded_, simulated, &off), quiet = squares(recorded_, simulated, nullptr),
             farther = squares(now(), simulate(data_, without), nullptr);
  for (std::size_t o = 0; o < shaken.size(); ++o)
    if (shaken[o] < ratio * ratio * farther[o] || quiet[o] < plain * plain * farther[o]) return true;
  return false;
}

double LoopNoise::gain(const physics::Model& with, const physics::Model& without,
                       const Weighing& weighing) const {
  const auto position = fed_back(data_);
  if (!position) return std::numeric_limits<double>::infinity();
  const auto off = softened(data_, recorded_, with, *position);
  auto shaken = simulate(data_, with);
  for (std::size_t r = 0; r < off.size(); ++r)
    for (std::size_t o = 0; o < off[r].size(); ++o)
      for (std::size_t i = 0; i < off[r][o].size();
           ++i)  // against what was recorded, whatever is taken off now
        shaken[r][o][i] += off[r][o][i] + data_.recordings[r].measured[o][i] - recorded_[r][o][i];
  return 0.5 * weighing.temper *
         (residual(data_, weighing, without).squaredNorm() - residual(data_, weighing, shaken).squaredNorm());
}

}  // namespace invar::diagnose
