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

/// Runs of a model with noise on the encoder. The noise is what the model `of` leaves of the readings, shifted against the
/// motion, with either sign: what is linear in it cancels.
std::vector<LoopNoise::Readings> shaken(const Case& data, const LoopNoise::Readings& recorded,
                                        const physics::Model& model, const physics::Model& of,
                                        std::size_t position, std::size_t shifts) {
  const auto quiet = simulate(data, of);
  std::vector<LoopNoise::Readings> runs(2 * shifts, LoopNoise::Readings(quiet.size()));
  in_parallel(runs.size() * quiet.size(), [&](std::size_t at) {
    if (data.stopped && data.stopped()) throw Stopped{};
    const std::size_t k = at % runs.size(), r = at / runs.size();
    const auto& time = data.recordings[r].inputs.time;
    const std::size_t n = time.size(), by = (k / 2 + 1) * n / (shifts + 1);
    physics::Model noisy = model;
    auto& reading = noisy.terms.emplace_back();
    reading.info = physics::unmodelled(physics::Plant::axis, "measurement");
    reading.curve.over = "time";
    reading.curve.knots = time;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t from = (i + by) % n;
      const double e = recorded[r][position][from] - quiet[r][position][from];
      reading.curve.values.push_back(std::isfinite(e) ? (k % 2 == 0 ? e : -e) : 0.0);
    }
    data.recordings[r].simulation->run(noisy, runs[k][r]);
  });
  return runs;
}

/// How far such runs lie, on average, from the run without noise.
LoopNoise::Readings softened(const Case& data, const LoopNoise::Readings& recorded,
                             const physics::Model& model, std::size_t position) {
  const auto quiet = simulate(data, model);
  const auto runs = shaken(data, recorded, model, model, position, 4);
  auto mean = quiet;
  for (std::size_t r = 0; r < mean.size(); ++r)
    for (std::size_t o = 0; o < mean[r].size(); ++o)
      for (std::size_t i = 0; i < mean[r][o].size(); ++i) {
        double sum = 0.0;
        for (const auto& one : runs) sum += one[r][o][i] - quiet[r][o][i];
        mean[r][o][i] = sum / static_cast<double>(runs.size());
      }
  return mean;
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

bool LoopNoise::is_fed_back() const { return fed_back(data_).has_value(); }

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

void LoopNoise::take_off(const physics::Model& model) {
  const auto position = fed_back(data_);
  if (!position) return;
  (void)put_back();
  const auto off = softened(data_, recorded_, model, *position);
  const auto simulated = simulate(data_, model);
  const auto before = squares(recorded_, simulated, nullptr), after = squares(recorded_, simulated, &off);
  double nearer = 0.0;
  for (std::size_t o = 0; o < before.size(); ++o)
    if (before[o] > 0.0 && after[o] > 0.0) nearer += std::log(before[o] / after[o]);
  if (!(nearer > 0.0)) return;
  for (std::size_t r = 0; r < off.size(); ++r)
    for (std::size_t o = 0; o < off[r].size(); ++o)
      for (std::size_t i = 0; i < off[r][o].size(); ++i) data_.recordings[r].measured[o][i] -= off[r][o][i];
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

double LoopNoise::beyond(const physics::Model& with, const physics::Model& without,
                         const Weighing& weighing) const {
  const auto position = fed_back(data_);
  if (!position) return std::numeric_limits<double>::infinity();
  const auto quiet = simulate(data_, without);
  const auto apart = [&](const Readings& readings) {
    Eigen::VectorXd all(weighing.rows);
    Eigen::Index at = 0;
    for (std::size_t r = 0; r < quiet.size(); ++r)
      for (std::size_t o = 0; o < quiet[r].size(); ++o)
        for (std::size_t i = 0; i < quiet[r][o].size(); ++i) all(at++) = readings[r][o][i] - quiet[r][o][i];
    return filtered(data_, weighing, all);
  };
  const Eigen::VectorXd effect = apart(simulate(data_, with));
  double sum = 0.0, square = 0.0;
  const auto runs = shaken(data_, recorded_, without, with, *position, 8);
  for (const auto& one : runs) {
    const double score = effect.dot(apart(one));
    sum += score, square += score * score;
  }
  const auto n = static_cast<double>(runs.size());
  const double variance = (square - sum * sum / n) / (n - 1.0), off = effect.dot(apart(recorded_)) - sum / n;
  return off > 0.0 && variance > 0.0 ? 0.5 * off * off / variance : 0.0;
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
