#include "core/diagnosis/evidence/loop_noise.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// The place of the encoder among the outputs; nothing where no loop feeds its noise back.
std::optional<std::size_t> fed_back(const Case& data) {
  const auto at = std::find(data.outputs.begin(), data.outputs.end(), "position");
  if (data.model.plant != physics::Plant::axis || !data.model.controller || at == data.outputs.end())
    return std::nullopt;
  return static_cast<std::size_t>(at - data.outputs.begin());
}

/// Does a carriage stick, or a reading or a current stay, while noise alone decides?
bool bends(const physics::Term& term) { return term.info->sticks_and_slips || term.with == "direction"; }

using Noise = std::vector<std::vector<double>>;  // of the encoder, by recording

/// What a model leaves of the readings of the encoder, without the rows in which chance decides.
Noise noise_left_by(const physics::Model& model, const Case& data, const LoopNoise::Readings& recorded,
                    std::size_t position) {
  const auto simulated = simulate(data, model);
  Noise noise(recorded.size());
  for (std::size_t r = 0; r < recorded.size(); ++r)
    for (std::size_t i = 0; i < recorded[r][position].size(); ++i)
      if (std::isfinite(data.recordings[r].measured[position][i]))
        noise[r].push_back(recorded[r][position][i] - simulated[r][position][i]);
  return noise;
}

/// Runs of a model with noise on the encoder, shifted against the motion, with either sign: what is linear in it cancels in
/// their average.
std::vector<LoopNoise::Readings> shaken(const physics::Model& model, const Case& data, const Noise& noise,
                                        std::size_t shifts) {
  std::vector<LoopNoise::Readings> runs(2 * shifts, LoopNoise::Readings(noise.size()));
  in_parallel(runs.size() * noise.size(), [&](std::size_t at) {
    if (data.stop.stop_requested()) throw Stopped{};
    const std::size_t k = at % runs.size(), r = at / runs.size();
    const auto& time = data.recordings[r].inputs.time;
    const std::size_t n = time.size(), by = (k / 2 + 1) * n / (shifts + 1);
    physics::Model noisy = model;
    auto& reading = noisy.terms.emplace_back();
    reading.info = physics::unmodelled(physics::Plant::axis, "measurement");
    reading.curve.over = "time";
    reading.curve.knots = time;
    for (std::size_t i = 0; i < n; ++i) {
      const double e = noise[r].empty() ? 0.0 : noise[r][(i + by) % noise[r].size()];
      reading.curve.values.push_back(k % 2 == 0 ? e : -e);
    }
    data.recordings[r].simulation->run(noisy, runs[k][r]);
  });
  return runs;
}

/// Of each row of the runs, this of where they lie beside the run without noise.
template <class Of>
LoopNoise::Readings row_by_row(const std::vector<LoopNoise::Readings>& runs, const LoopNoise::Readings& quiet,
                               Of of) {
  auto out = quiet;
  std::vector<double> apart(runs.size());
  for (std::size_t r = 0; r < out.size(); ++r)
    for (std::size_t o = 0; o < out[r].size(); ++o)
      for (std::size_t i = 0; i < out[r][o].size(); ++i) {
        for (std::size_t k = 0; k < runs.size(); ++k) apart[k] = runs[k][r][o][i] - quiet[r][o][i];
        out[r][o][i] = of(apart);
      }
  return out;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

double variance_of(const std::vector<double>& values) {
  const double mean = mean_of(values);
  double sum = 0.0;
  for (double v : values) sum += (v - mean) * (v - mean);
  return sum / static_cast<double>(values.size() - 1);
}

constexpr std::size_t few_shifts = 4;

/// How far runs with noise lie, on average, from the run without.
LoopNoise::Readings softened(const Case& data, const LoopNoise::Readings& recorded,
                             const physics::Model& model, std::size_t position,
                             std::size_t shifts = few_shifts) {
  const auto noise = noise_left_by(model, data, recorded, position);
  return row_by_row(shaken(model, data, noise, shifts), simulate(data, model), mean_of);
}

/// By recording and row: do runs with noise scatter there as noise does that goes round in a loop without bends? Where the
/// carriage sticks in one run and slips in another, none says when it did in the recording.
std::vector<std::vector<bool>> told_by(const LoopNoise::Readings& variance,
                                       const LoopNoise::Readings& without_bends) {
  constexpr std::size_t beside = 10;  // rows, since eight runs alone say little of their scatter
  std::vector<std::vector<bool>> told(variance.size());
  for (std::size_t r = 0; r < told.size(); ++r) {
    const std::size_t n = variance[r].front().size();
    told[r].assign(n, true);
    for (std::size_t o = 0; o < variance[r].size(); ++o)
      for (std::size_t i = 0; i < n; ++i) {
        double with = 0.0, expected = 0.0;
        for (std::size_t k = i > beside ? i - beside : 0; k < std::min(n, i + beside + 1); ++k)
          with += variance[r][o][k], expected += without_bends[r][o][k];
        if (with > thresholds::told_scatter * expected) told[r][i] = false;
      }
  }
  return told;
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

std::size_t LoopNoise::left_to_chance() const {
  std::size_t rows = 0;
  for (std::size_t r = 0; r < recorded_.size(); ++r)
    for (std::size_t i = 0; i < recorded_[r].front().size(); ++i)
      if (std::isfinite(recorded_[r].front()[i]) && !std::isfinite(data_.recordings[r].measured.front()[i]))
        ++rows;
  return rows;
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
  if (std::none_of(model.terms.begin(), model.terms.end(), bends)) {
    (void)put_back();
    return 0.0;
  }
  const auto noise = noise_left_by(model, data_, recorded_, *position);
  (void)put_back();
  const auto simulated = simulate(data_, model);
  const auto runs = shaken(model, data_, noise, few_shifts);
  const auto off = row_by_row(runs, simulated, mean_of);
  const auto before = squares(recorded_, simulated, nullptr), after = squares(recorded_, simulated, &off);
  double nearer = 0.0;
  for (std::size_t o = 0; o < before.size(); ++o)
    if (before[o] > 0.0 && after[o] > 0.0) nearer += std::log(before[o] / after[o]);
  auto without = model;
  without.terms.resize(data_.model.terms.size());
  const auto told =
      told_by(row_by_row(runs, simulated, variance_of),
              row_by_row(shaken(without, data_, noise, few_shifts), simulate(data_, without), variance_of));
  double untold = 0.0, rows = 0.0;
  for (const auto& one : told) {
    rows += static_cast<double>(one.size());
    untold += static_cast<double>(std::count(one.begin(), one.end(), false));
  }
  // Where chance would decide in most rows there would be nothing left to judge by: a loop that hardly holds scatters so.
  const bool is_judged = untold < thresholds::most_left_to_chance * rows;
  for (std::size_t r = 0; r < off.size(); ++r)
    for (std::size_t o = 0; o < off[r].size(); ++o)
      for (std::size_t i = 0; i < off[r][o].size(); ++i) {
        auto& measured = data_.recordings[r].measured[o][i];
        if (nearer > 0.0) measured -= off[r][o][i];
        if (is_judged && !told[r][i]) measured = std::numeric_limits<double>::quiet_NaN();
      }
  return is_judged ? untold / rows : 0.0;
}

std::vector<physics::Outputs> LoopNoise::shaken_mean(const physics::Model& model, Runs runs) const {
  auto mean = simulate(data_, model);
  const auto position = fed_back(data_);
  if (!position) return mean;
  const auto off = softened(data_, recorded_, model, *position, runs == Runs::two ? 1 : few_shifts);
  for (std::size_t r = 0; r < off.size(); ++r)
    for (std::size_t o = 0; o < off[r].size(); ++o)
      for (std::size_t i = 0; i < off[r][o].size(); ++i) mean[r][o][i] += off[r][o][i];
  return mean;
}

bool LoopNoise::shows(const physics::Model& with, const physics::Model& without, double ratio) const {
  const auto position = fed_back(data_);
  if (!position) return true;
  const auto off = softened(data_, recorded_, with, *position);
  const auto simulated = simulate(data_, with);
  // Where a shaken carriage sticks here and slips there the average says little; then what takes a fifth off without noise counts.
  const auto shaken = squares(recorded_, simulated, &off), quiet = squares(recorded_, simulated, nullptr),
             farther = squares(now(), simulate(data_, without), nullptr);
  for (std::size_t o = 0; o < shaken.size(); ++o)
    if (shaken[o] < ratio * ratio * farther[o] ||
        quiet[o] < thresholds::plain_without_noise * thresholds::plain_without_noise * farther[o])
      return true;
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
  std::vector<double> scores;
  for (const auto& one : shaken(without, data_, noise_left_by(with, data_, recorded_, *position), 8))
    scores.push_back(effect.dot(apart(one)));
  const double variance = variance_of(scores), off = effect.dot(apart(recorded_)) - mean_of(scores);
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

}  // namespace invar::diagnosis
