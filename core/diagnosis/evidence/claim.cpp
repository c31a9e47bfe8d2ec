#include "core/diagnosis/evidence/claim.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

using physics::Role;
using physics::Term;

std::string label(const Term& term) {
  std::string text{term.info->name};
  if (!term.on.empty()) text += "@" + term.on;
  if (!term.with.empty()) text += "+" + term.with;
  return text;
}

namespace {

/// Rates against the motion take energy out of it; one that brings some in is no drag, however well it fits.
bool brings_energy(const physics::Model& model, const Term& term) {
  const auto name = term.info->name;
  if (!term.with.empty() || term.values[0] <= 0.0 ||
      (name != "linear" && name != "quadratic" && name != "cubic"))
    return false;
  return std::any_of(model.equations.states.begin(), model.equations.states.end(),
                     [&](const auto& state) { return state.derivative == term.on; });
}

/// Does a further term do nothing but change a number that the user knows exactly? A steady rate beside a known gravity, once
/// there is drag. The only one that explains the recording is said: what is new then is not the number.
bool is_known_better(const Case& data, const Fit& fit, std::size_t term) {
  if (fit.model.terms.size() == data.model.terms.size() + 1) return false;
  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    if (fit.free[k].where != Freedom::Where::term || fit.free[k].term != term) continue;
    if (fit.columns.cols() != static_cast<Eigen::Index>(fit.free.size()) ||
        fit.model.terms[term].info->parameter_count() != 1)
      return false;
    const auto finite = [](double v) { return std::isfinite(v) ? v : 0.0; };
    const Eigen::VectorXd own = fit.columns.col(static_cast<Eigen::Index>(k)).unaryExpr(finite);
    for (std::size_t p = 0; p < data.model.parameters.size(); ++p) {
      const auto& parameter = data.model.parameters[p];
      if (!parameter.sigma || *parameter.sigma != 0.0 || parameter.value == 0.0) continue;
      Freedom known;
      known.index = p, known.scale = std::abs(parameter.value);
      const Eigen::VectorXd other = sensitivities(data, fit.model, {known}).col(0).unaryExpr(finite);
      if (std::abs(own.dot(other)) > 0.9999 * own.norm() * other.norm()) return other.norm() > 0.0;
    }
  }
  return false;
}

/// Did the recording let the term show what sets it apart?
bool acts(const Case& data, const physics::Model& model, const Term& term) {
  const std::string& over = physics::goes_over(term);
  const auto [low, high] = span_of(data, model, over);
  const double size = std::max(std::abs(low), std::abs(high));
  // What repeats must have been seen to repeat, and not by a few rows: half a wave is any bent law. Time goes on steadily.
  if (term.info->name == "periodic")
    return (over == "t" ? high - low : inner_span_of(data, model, over)) >= 2.0 * term.values[1];
  // Friction that never turned nor held is a constant.
  if (term.info->name == "dry_friction" && term.with == term.on) return turns(data, model, term.on);
  if (term.info->name == "dry_friction")
    return (low < -0.03 * size && high > 0.03 * size) || rests(data, model, over);
  if (!term.info->parameters[0].name.starts_with("limit")) return true;
  // A limit that one or two rows touch is an outlier.
  auto free = model;
  std::erase_if(free.terms,
                [&](const Term& t) { return t.info == term.info && t.on == term.on && t.with == term.with; });
  const auto with = simulate(data, model), without = simulate(data, free);
  std::size_t rows = 0;
  for (std::size_t r = 0; r < with.size(); ++r)
    for (std::size_t o = 0; o < with[r].size(); ++o)
      for (std::size_t i = 0; i < with[r][o].size(); ++i)
        rows += std::abs(with[r][o][i] - without[r][o][i]) > 1e-6 * std::abs(with[r][o][i]) ? 1U : 0U;
  return rows >= 5;
}

/// Was what repeats seen to repeat? Less than two waves are any bent course. Of an axis one and a half will do: there a free
/// course over the position is tried in its place.
bool repeats(const Case& data, const Term& term) {
  const auto pitch = term.info->index_of("pitch"), frequency = term.info->index_of("frequency");
  if (term.info->index_of("phase") == physics::most_parameters) return true;
  const bool in_place = pitch < physics::most_parameters;
  if (!in_place && frequency == physics::most_parameters) return true;
  std::vector<double> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto* name = !in_place                                    ? "time"
                       : data.model.plant == physics::Plant::sensor ? "true_position"
                                                                    : "position";
    const auto values = variable_values(data, r, name);
    all.insert(all.end(), values.begin(), values.end());
  }
  if (all.empty()) return true;
  std::sort(all.begin(), all.end());
  const double span = all[all.size() - 1 - all.size() / 200] - all[all.size() / 200];
  const double least = in_place && data.model.plant == physics::Plant::axis ? 1.5 : 2.0;
  return span * (in_place ? 1.0 / term.values[pitch] : term.values[frequency]) >= least;
}

/// The frequency of a term that is a wave in time [Hz]; 0: it is none.
double wave_of(const physics::Model& model, const Term& term) {
  if (term.info->index_of("phase") == physics::most_parameters) return 0.0;
  if (const auto at = term.info->index_of("frequency"); at < physics::most_parameters) return term.values[at];
  const auto period = term.info->index_of("period");
  return model.plant == physics::Plant::equations && term.with == "t" && period < physics::most_parameters
             ? 1.0 / term.values[period]
             : 0.0;
}

/// Does the machine swing with this wave already without it? Then any wrong number of its laws leaves such a wave, and
/// nothing that comes from outside can be told from that.
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

/// Does a wave in time explain something all along? One that begins throws a slow loop off at once, and would explain whatever
/// the start leaves.
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
  return *std::max_element(gain.begin(), gain.end()) < 0.6 * all;
}

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

/// Is what a sine explains a line, with one phase from beginning to end? A hum of the noise has a band, and what coarse
/// steps make of a motion has another phase in every pass, however much evidence a sine in it gathers. Against the scatter
/// of its amplitude from block to block (Fisher's F), strictly where that is more than rows without memory would make.
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

/// Would readings rounded to their own steps show the wave without it? Steps beat against the distance between rows and
/// against the steps of the instrument itself.
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
    if (std::abs(rounded) > 0.4 * std::abs(seen)) return true;
  }
  return false;
}

/// Does the error of a map turn with the direction of approach, as play says? A constant error does not, however much a
/// play explains of it where nearly all points were approached from one side.
bool turns_with_direction(const Case& data, const physics::Model& model, std::size_t term) {
  const auto& play = model.terms[term];
  if (play.info->plant != physics::Plant::error_map || play.info->name != "backlash") return true;
  const auto without = simulate(data, physics::without_term(model, term));
  std::array<double, 2> sum{}, square{}, rows{};
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto direction = variable_values(data, r, "direction");
    for (std::size_t i = 0; i < direction.size(); ++i)
      if (const double e = data.recordings[r].measured[0][i] - without[r][0][i];
          std::isfinite(e) && direction[i] != 0.0) {
        const std::size_t side = direction[i] > 0.0 ? 1 : 0;
        sum[side] += e, square[side] += e * e, rows[side] += 1.0;
      }
  }
  if (rows[0] < 2.0 || rows[1] < 2.0) return false;
  double difference = 0.0, variance = 0.0;
  for (const std::size_t side : {0U, 1U}) {
    const double mean = sum[side] / rows[side];
    difference += side == 1 ? mean : -mean;
    variance += (square[side] / rows[side] - mean * mean) / (rows[side] - 1.0);
  }
  return difference / play.values[0] > 0.5 && std::abs(difference) > 3.0 * std::sqrt(variance);
}

/// A store through which the whole of a signal goes is a lag: what makes it a store, the part that passes it by, is zero.
bool is_lag(const Fit& fit, std::size_t term) {
  const auto& store = fit.model.terms[term];
  const auto& states = fit.model.equations.states;
  if (store.info->plant != physics::Plant::equations || store.info->name != "hidden_state" ||
      std::any_of(states.begin(), states.end(), [&](const auto& state) { return state.name == store.on; }))
    return false;
  double sigma = 0.0;
  for (std::size_t k = 0; k < fit.free.size(); ++k)
    if (const auto& f = fit.free[k]; f.where == Freedom::Where::term && f.term == term && f.index == 0)
      sigma = fit.sigma(static_cast<Eigen::Index>(k));
  return store.values[0] > 1.0 - std::max(0.05, 3.0 * sigma);
}

/// A store behind a state that fills so slowly that the recording cannot tell it from one that never does: that is a rate
/// in proportion and a steady one.
bool never_fills(const Case& data, const Fit& fit, std::size_t term) {
  const auto& store = fit.model.terms[term];
  if (store.info->plant != physics::Plant::equations || store.info->name != "hidden_state") return false;
  if (!(store.values[1] > longest(data))) return false;
  for (std::size_t k = 0; k < fit.free.size(); ++k)
    if (const auto& f = fit.free[k]; f.where == Freedom::Where::term && f.term == term && f.index == 1)
      return store.values[1] <
             3.0 * fit.sigma(static_cast<Eigen::Index>(k));  // 1 / time constant: 0 +- sigma
  return false;
}

}  // namespace

bool is_affordable(const Case& data, const Fit& fit) {
  constexpr double rows_a_number = 14.0;
  double rows = 0.0;
  for (const auto& recording : data.recordings)
    for (const auto& measured : recording.measured)
      for (double v : measured) rows += std::isfinite(v) ? 1.0 : 0.0;
  return rows >= rows_a_number * static_cast<double>(fit.free.size());
}

bool stands(const Case& data, const Fit& fit, std::size_t term) {
  const auto& info = *fit.model.terms[term].info;
  const auto& values = fit.model.terms[term].values;
  // A shape at the end of its range is another term in disguise.
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    auto p = info.parameters[i];
    p.bounds = physics::bounds_of_parameter(data.model, fit.model.terms[term], i);
    if (p.role == Role::amplitude && p.bounds.upper < 1e100 && std::abs(values[i]) > 0.99 * p.bounds.upper)
      return false;
    if (p.role != Role::shape || p.name == "center" || p.name == "limit" || p.name == "squareness") continue;
    if (p.name == "damping_ratio" && values[i] < 0.5) continue;  // what rings for long is a mode all the same
    if (p.bounds.lower > 0.0 && p.bounds.upper > 100.0 * p.bounds.lower && values[i] < 1.3 * p.bounds.lower)
      return false;
    if (p.bounds.upper < 1e100 && p.bounds.upper > 0.0 && values[i] > 0.99 * p.bounds.upper) return false;
  }
  if (data.model.plant == physics::Plant::equations &&
      (brings_energy(fit.model, fit.model.terms[term]) || !is_affordable(data, fit) ||
       is_known_better(data, fit, term) || !acts(data, fit.model, fit.model.terms[term])))
    return false;
  if (!repeats(data, fit.model.terms[term]) || !is_line(data, fit.model, term) ||
      !lasts(data, fit.model, term) || is_its_own(data, fit.model, term) ||
      is_rounding(data, fit.model, term) || !turns_with_direction(data, fit.model, term))
    return false;
  if (is_lag(fit, term) || never_fills(data, fit, term)) return false;
  if (info.name == "overflow" && values[1] < 0.05)
    return false;  // what runs over to nowhere is an upper limit
  // Friction that is smaller at rest than at speed is none.
  if (info.name == "stribeck_friction" && values[1] < 1.1 * values[0]) return false;

  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    const auto& f = fit.free[k];
    if (f.where != Freedom::Where::term || f.term != term) continue;
    if (info.parameters[f.index].role != Role::amplitude) continue;
    if (std::abs(get(fit.model, f)) > 3.0 * fit.sigma(static_cast<Eigen::Index>(k))) return true;
  }
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    if (info.parameters[i].role == Role::amplitude) return false;
  return true;  // a term of shapes alone, or a curve
}

}  // namespace invar::diagnosis
