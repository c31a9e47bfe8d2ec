#include "core/diagnosis/evidence/waves.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

using physics::Term;

namespace {

/// The frequency of a term that is a wave in time [Hz]; 0: it is none.
double wave_of(const physics::Model& model, const Term& term) {
  if (term.info->index_of("phase") == physics::most_parameters) return 0.0;
  if (const auto at = term.info->index_of("frequency"); at < physics::most_parameters) return term.values[at];
  const auto period = term.info->index_of("period");
  return model.plant == physics::Plant::equations && term.with == "t" && period < physics::most_parameters
             ? 1.0 / term.values[period]
             : 0.0;
}

}  // namespace

bool is_its_own(const Case& data, const physics::Model& model, std::size_t term) {
  constexpr double turns = 5.0;  // of the wave in a block: a tenth of its frequency is one band
  const double frequency = wave_of(model, model.terms[term]);
  if (!(frequency > 0.0)) return false;
  const auto without = simulate(data, physics::without_term(model, term));
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double blocks = 0.0, own = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& time = data.recordings[r].inputs.time;
      const auto& x = without[r][o];
      for (std::size_t i = 0; i < time.size();) {
        const double until = time[i] + turns / frequency;
        const std::size_t begin = i;
        double mean = 0.0;
        for (; i < time.size() && time[i] < until; ++i) mean += x[i];
        if (time.back() < until) break;  // any motion is a part of a wave
        const auto n = static_cast<double>(i - begin);
        double all = 0.0;
        std::complex<double> sum;
        for (std::size_t k = begin; k < i; ++k) {
          const double e = x[k] - mean / n;
          all += e * e;
          sum += e * std::polar(1.0, -2.0 * std::numbers::pi * frequency * time[k]);
        }
        blocks += 1.0;
        if (all > 0.0 && 2.0 * std::norm(sum) / n > 0.7 * all) own += 1.0;
      }
    }
    if (own > 0.0 && own >= 0.25 * blocks)
      return true;  // a swing that decays has its small one's frequency for a part alone
  }
  return false;
}

namespace {

/// The turns [rad] of a wave at the rows of a recording: in time, or along what an instrument is held against. Empty for
/// a wave that reaches the output by way of the machine, whose answer depends on the speed.
std::vector<double> angles_of(const Case& data, const physics::Model& model, const Term& term,
                              std::size_t recording) {
  const auto pitch = term.info->index_of("pitch");
  const bool along = data.model.plant == physics::Plant::sensor && pitch < physics::most_parameters;
  const double frequency = wave_of(model, term);
  if (!along && !(frequency > 0.0)) return {};
  auto angles =
      along ? variable_values(data, recording, "true_position") : data.recordings[recording].inputs.time;
  for (double& angle : angles)
    angle *= 2.0 * std::numbers::pi * (along ? 1.0 / term.values[pitch] : frequency);
  return angles;
}

/// Is what a wave in time does to the machine, for the most part, a motion at its own frequency? What is faster than the
/// machine also shakes friction loose, as the noise of the readings does, and then explains what noise made.
bool acts_at_its_frequency(const Case& data, const physics::Model& model, std::size_t term) {
  constexpr double turns = 5.0;  // in a block
  const auto square = model.terms[term].info->index_of("squareness");
  const double frequency = wave_of(model, model.terms[term]);
  if (model.plant != physics::Plant::axis || !(frequency > 0.0) ||
      (square < physics::most_parameters && model.terms[term].values[square] > 0.5))
    return true;
  const auto with = simulate(data, model), without = simulate(data, physics::without_term(model, term));
  double own = 0.0, all = 0.0;  // of all outputs, each by what it leaves
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double own_here = 0.0, all_here = 0.0, left = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& time = data.recordings[r].inputs.time;
      for (std::size_t i = 0; i < time.size();) {
        const double until = time[i] + turns / frequency;
        const std::size_t begin = i;
        std::complex<double> sum;
        for (; i < time.size() && time[i] < until; ++i) {
          const double e = with[r][o][i] - without[r][o][i];
          all_here += e * e;
          sum += e * std::polar(1.0, -2.0 * std::numbers::pi * frequency * time[i]);
          if (const double rest = data.recordings[r].measured[o][i] - with[r][o][i]; std::isfinite(rest))
            left += rest * rest;
        }
        own_here += 2.0 * std::norm(sum) / static_cast<double>(i - begin);
      }
    }
    if (left > 0.0) own += own_here / left, all += all_here / left;
  }
  return own >= 0.5 * all;
}

}  // namespace

bool lasts(const Case& data, const physics::Model& model, std::size_t term) {
  const auto& info = *model.terms[term].info;
  const auto onset = info.index_of("onset");
  if (onset == physics::most_parameters) return true;
  const double from = model.terms[term].values[onset];
  constexpr std::size_t count = 8;
  std::array<double, count> gain{};
  const auto with = simulate(data, model), without = simulate(data, physics::without_term(model, term));
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::array<double, count> gained{};
    double squares = 0.0, rows = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& time = data.recordings[r].inputs.time;
      const double lasted = time.back() - time.front();
      for (std::size_t i = 0; i < time.size(); ++i) {
        const double y = data.recordings[r].measured[o][i];
        if (!std::isfinite(y) || time[i] < from) continue;
        const double left = y - with[r][o][i], was = y - without[r][o][i];
        gained[std::min(count - 1, static_cast<std::size_t>(static_cast<double>(count) *
                                                            (time[i] - time.front()) / lasted))] +=
            was * was - left * left;
        squares += left * left, rows += 1.0;
      }
    }
    for (std::size_t b = 0; b < count && squares > 0.0; ++b) gain[b] += gained[b] * rows / squares;
  }
  double all = 0.0;
  for (const double one : gain) all += one;
  return *std::max_element(gain.begin(), gain.end()) < thresholds::lasts_share * all;
}

namespace {

/// The amplitude of a wave block by block, of one output.
struct Amplitudes {
  std::vector<std::complex<double>> blocks;
  double weights_squared = 0.0;      // of the windows
  double squares = 0.0, rows = 0.0;  // of what the model leaves
};

/// `with`, `without`: what the model simulates with the wave and without it.
Amplitudes amplitudes_of(const Case& data, const physics::Model& model, std::size_t term, std::size_t o,
                         const std::vector<physics::Outputs>& with,
                         const std::vector<physics::Outputs>& without) {
  Amplitudes all;
  auto& [blocks, weights_squared, squares, rows] = all;
  const auto onset = model.terms[term].info->index_of("onset");
  const double from = onset < physics::most_parameters ? model.terms[term].values[onset] : -1e300;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& time = data.recordings[r].inputs.time;
    const auto angles = angles_of(data, model, model.terms[term], r);
    // The turns gone through until each row, to and fro. Blocks are alike in them, and so much does each row count: rest
    // between two moves, however long, shows nothing of a wave along the way.
    std::vector<double> gone(time.size(), 0.0);
    for (std::size_t i = 1; i < time.size(); ++i)
      gone[i] = gone[i - 1] + (time[i] > from ? std::abs(angles[i] - angles[i - 1]) : 0.0);
    const double way = gone.back(), most = 5.0 * way / static_cast<double>(time.size());
    const double count = std::min(16.0, std::floor(0.25 * way / std::numbers::pi));
    for (double b = 0.0; b < count; b += 1.0) {
      const double low = way * b / count, high = way * (b + 1.0) / count;
      std::complex<double> sum;
      std::array<double, 2> level{}, power{};  // of the two ends: a slow rest is no line
      for (int pass = 0; pass < 2; ++pass)
        for (auto i =
                 static_cast<std::size_t>(std::lower_bound(gone.begin(), gone.end(), low) - gone.begin());
             i < time.size() && gone[i] < high; ++i) {
          const double e = data.recordings[r].measured[o][i] - without[r][o][i];
          if (!std::isfinite(e) || (pass == 1 && !(power[0] > 0.0 && power[1] > 0.0))) continue;
          const double s = (gone[i] - low) / (high - low),
                       step = std::min(most, gone[std::min(i + 1, gone.size() - 1)] - gone[i]),
                       window = step * (1.0 - std::cos(2.0 * std::numbers::pi * s));
          const double weights[2] = {window * (1.0 - s), window * s};
          if (pass == 0) {
            for (std::size_t k = 0; k < 2; ++k) level[k] += weights[k] * e, power[k] += weights[k];
          } else {
            const double slow = (1.0 - s) * level[0] / power[0] + s * level[1] / power[1];
            sum += window * (e - slow) * std::polar(1.0, -angles[i]);
            weights_squared += window * window;
            squares += std::pow(data.recordings[r].measured[o][i] - with[r][o][i], 2), rows += 1.0;
          }
        }
      if (power[0] > 0.0 && power[1] > 0.0) blocks.push_back(sum);
    }
  }
  return all;
}

}  // namespace

bool is_line(const Case& data, const physics::Model& model, std::size_t term) {
  if (angles_of(data, model, model.terms[term], 0).empty()) return true;
  const auto with = simulate(data, model), without = simulate(data, physics::without_term(model, term));
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto [blocks, weights_squared, squares, rows] = amplitudes_of(data, model, term, o, with, without);
    const auto n = static_cast<double>(blocks.size());
    if (n < 6.0) return true;  // too few waves to tell
    std::complex<double> mean;
    for (const auto& block : blocks) mean += block / n;
    double scatter = 0.0;
    for (const auto& block : blocks) scatter += std::norm(block - mean);
    // F of 2 and 2 (n - 1) degrees of freedom and its tail.
    const double share = scatter > 0.0 ? n * std::norm(mean) / scatter : 1e300;
    const double by_chance = std::pow(1.0 + share, 1.0 - n), white = squares / rows * weights_squared;
    // Mildly only where the evidence for it comes from its own frequency too, which was looked for among many.
    constexpr double strict = 1e-5, mild = 1e-2, louder = 2.0;
    if (by_chance < strict) return true;
    if (by_chance < mild && scatter < louder * white && acts_at_its_frequency(data, model, term)) return true;
  }
  return false;
}

namespace {

/// The step between readings that stand on a lattice: what divides all their distances (Euclid). 0: nothing does.
double step_of(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.size() < 2) return 0.0;
  std::sort(values.begin(), values.end());
  const double fine = 1e-8 * (values.back() - values.front());
  double step = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    double rest = values[i] - values[i - 1];
    if (step == 0.0 && rest > fine) step = rest;
    while (rest > fine && std::abs(std::remainder(rest, step)) > 0.01 * step) {
      const double smaller = std::abs(std::remainder(rest, step));
      rest = step, step = smaller;
    }
    if (step > 0.0 && step < fine) return 0.0;
  }
  return step;
}

}  // namespace

bool is_rounding(const Case& data, const physics::Model& model, std::size_t term) {
  if (angles_of(data, model, model.terms[term], 0).empty()) return false;
  const auto with = simulate(data, model), without = simulate(data, physics::without_term(model, term));
  const auto to_steps = [](double value, double step) {
    return step > 0.0 ? step * std::round(value / step) : value;
  };
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const double known = data.outputs[o] == "encoder" ? data.resolution : 0.0;
    std::complex<double> seen, rounded;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& y = data.recordings[r].measured[o];
      const double step = step_of(y);
      if (!(step > 0.0)) continue;
      // Its own steps, written with so many digits, are no second lattice that beats against them.
      const bool is_known = std::abs(step - known) < 0.02 * known;
      const std::size_t n = y.size();
      std::vector<double> noise(n);
      double square = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        noise[i] = std::isfinite(y[i]) ? y[i] - with[r][o][i] : 0.0;
        square += noise[i] * noise[i] / static_cast<double>(n);
      }
      // What is left holds the rounding already; that much of it is taken away.
      const double fine = ((is_known ? 0.0 : step * step) + known * known) / 12.0;
      const double share = std::sqrt(std::max(0.0, 1.0 - fine / std::max(square, 1e-300)));
      const auto angles = angles_of(data, model, model.terms[term], r);
      for (std::size_t i = 0; i < n; ++i) {
        if (!std::isfinite(y[i])) continue;
        const auto turn = std::polar(1.0, -angles[i]);
        seen += (y[i] - without[r][o][i]) * turn;
        constexpr std::size_t shifts = 5;  // of the noise against the motion
        for (std::size_t k = 1; k <= shifts; ++k) {
          const double exact = without[r][o][i] + share * noise[(i + k * n / (shifts + 1)) % n],
                       level = to_steps(exact, known);
          rounded +=
              (is_known ? level - exact : to_steps(level, step) - level) * turn / static_cast<double>(shifts);
        }
      }
    }
    if (std::abs(rounded) > thresholds::rounding_share * std::abs(seen)) return true;
  }
  return false;
}

}  // namespace invar::diagnosis
