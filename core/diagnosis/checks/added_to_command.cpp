#include "core/diagnosis/checks/added_to_command.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "core/base/quantity.hpp"
#include "core/diagnosis/locate/lines.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Term;

/// Cycles one behind the other of all recordings, with what the law asks for and what the current is beyond.
struct LawSeries {
  std::vector<double> time, asked, beyond;
  double squares = 0.0;  // of `beyond`
  double noise = 0.0;    // 1 sigma of `beyond`, as neighbours tell
};

/// Only rows that the law speaks of. Where its level is open the middle of what it leaves is taken for zero, so that what acts
/// at times (a limit) leaves the rest at rest.
LawSeries series_of(const Case& data, const std::vector<LawRows>& law) {
  LawSeries all;
  for (std::size_t r = 0; r < law.size(); ++r) {
    const double level = law[r].has_open_level ? median(law[r].beyond) : 0.0;
    for (std::size_t i = 0; i < law[r].beyond.size(); ++i)
      if (std::isfinite(law[r].beyond[i])) {
        all.time.push_back(data.recordings[r].inputs.time[i]);
        all.asked.push_back(law[r].asked[i] + level), all.beyond.push_back(law[r].beyond[i] - level);
      }
  }
  for (const double b : all.beyond) all.squares += b * b;
  all.noise = spread_of_differences(all.beyond);
  return all;
}

/// The rows in which the law asks for much: at rest readings that the controller did not see look like a dead zone, and like
/// steps.
LawSeries asked_much(const LawSeries& all) {
  double squares = 0.0;
  for (const double u : all.asked) squares += u * u;
  const double least = 0.5 * std::sqrt(squares / static_cast<double>(all.asked.size()));
  LawSeries much;
  for (std::size_t i = 0; i < all.asked.size(); ++i)
    if (std::abs(all.asked[i]) > least) {
      much.time.push_back(all.time[i]);
      much.asked.push_back(all.asked[i]), much.beyond.push_back(all.beyond[i]);
      much.squares += all.beyond[i] * all.beyond[i];
    }
  return much;
}

struct Guess {
  Added added;
  double left = 0.0;                           // squares
  double numbers = 1.0;                        // that were free
  std::function<double(double)> becomes = {};  // of the command; empty: the time says what is added
};

/// The squares of what is beyond the law less what a kind makes of the command.
double left_by(const LawSeries& series, const std::function<double(double)>& becomes) {
  double left = 0.0;
  for (std::size_t i = 0; i < series.beyond.size(); ++i) {
    const double e = series.asked[i] + series.beyond[i] - becomes(series.asked[i]);
    left += e * e;
  }
  return left;
}

/// The value of a scan that leaves least, made finer about it.
double least_of(const std::vector<double>& values, const std::function<double(double)>& left) {
  std::size_t best = 0;
  std::vector<double> lefts;
  for (const double v : values) lefts.push_back(left(v));
  for (std::size_t k = 1; k < values.size(); ++k)
    if (lefts[k] < lefts[best]) best = k;
  double low = values[best > 0 ? best - 1 : 0], high = values[std::min(best + 1, values.size() - 1)];
  constexpr double golden = 0.618;
  double at = values[best], least = lefts[best];
  for (int step = 0; step < 40; ++step) {
    const double one = high - golden * (high - low), two = low + golden * (high - low), left_one = left(one),
                 left_two = left(two);
    if (left_one < left_two)
      high = two;
    else
      low = one;
    for (const auto& [v, l] : {std::pair{one, left_one}, {two, left_two}})
      if (l < least) least = l, at = v;
  }
  return at;
}

std::vector<double> evenly(double from, double to, double step) {
  std::vector<double> values{from};
  for (double v = from + step; step > 0.0 && v <= to; v += step) values.push_back(v);
  return values;
}

/// A curve that is added to the command, over the command itself.
Term curve_on_command(std::vector<double> knots, std::vector<double> values, double period = 0.0) {
  Term term;
  term.info = physics::unmodelled(physics::Plant::axis, "actuator");
  term.with = "command";
  term.curve.over = "current";
  term.curve.knots = std::move(knots), term.curve.values = std::move(values), term.curve.period = period;
  return term;
}

std::string amperes(double value) { return si(value, "A"); }

Guess offset(const LawSeries& series) {
  double sum = 0.0;
  for (const double b : series.beyond) sum += b;
  const double mean = sum / static_cast<double>(series.beyond.size());
  Guess guess;
  guess.left = series.squares - sum * mean;
  guess.added.term = curve_on_command({series.time.front(), series.time.back()}, {mean, mean});
  guess.added.term.curve.over = "time";
  guess.added.words = "an offset of " + amperes(mean);
  return guess;
}

/// The command never passes a limit, smaller than the law's own.
Guess limit(const LawSeries& series) {
  double top = 0.0, most = 0.0;
  for (std::size_t i = 0; i < series.asked.size(); ++i)
    top = std::max(top, std::abs(series.asked[i])),
    most = std::max(most, std::abs(series.asked[i] + series.beyond[i]));
  const auto limited = [](double at) { return [at](double u) { return std::clamp(u, -at, at); }; };
  constexpr double places = 200.0;
  const double at = least_of(evenly(0.05 * most, 1.05 * most, most / places),
                             [&](double a) { return left_by(series, limited(a)); });
  Guess guess;
  guess.becomes = limited(at);
  const double beyond = std::max(top, 1.01 * at);
  guess.added.term = curve_on_command({-beyond, -at, at, beyond}, {beyond - at, 0.0, 0.0, at - beyond});
  guess.added.words = "a limit at " + amperes(at);
  return guess;
}

Guess dead_zone(const LawSeries& series) {
  double top = 0.0;
  for (const double u : series.asked) top = std::max(top, std::abs(u));
  const auto lost = [](double width) {
    return [width](double u) { return std::copysign(std::max(0.0, std::abs(u) - width), u); };
  };
  constexpr double places = 400.0;
  const double width = least_of(evenly(top / places, 0.5 * top, top / places),
                                [&](double w) { return left_by(series, lost(w)); });
  Guess guess;
  guess.becomes = lost(width);
  guess.added.term = started("dead_zone");
  guess.added.term.values[0] = width;
  guess.added.words = "a dead zone of " + amperes(width) + " on each side of zero";
  return guess;
}

/// The current comes in steps, about zero as a converter counts; nothing where what is left is finer than any step to tell.
std::optional<Guess> steps(const LawSeries& series) {
  double top = 0.0;
  for (const double u : series.asked) top = std::max(top, std::abs(u));
  const auto stepped = [](double step) { return [step](double u) { return step * std::round(u / step); }; };
  constexpr std::size_t enough = 1500;  // rows, to find the place
  LawSeries thin;
  for (std::size_t i = 0; i < series.asked.size(); i += 1 + series.asked.size() / enough)
    thin.asked.push_back(series.asked[i]), thin.beyond.push_back(series.beyond[i]);
  // Steps whose count over the range is off by a quarter are lost: so fine a scan, from what noise hides to the range.
  const double rms = std::sqrt(series.squares / static_cast<double>(series.beyond.size()));
  std::vector<double> values;
  for (double step = std::max(2.0 * rms, thresholds::finest_steps * top); step < std::min(top, 6.0 * rms);
       step *= 1.0 + 0.2 * step / top)
    values.push_back(step);
  if (values.size() < 3) return std::nullopt;
  const double near = least_of(values, [&](double step) { return left_by(thin, stepped(step)); }),
               step = least_of({0.999 * near, near, 1.001 * near},
                               [&](double a) { return left_by(series, stepped(a)); }),
               edge = 0.5 * step, before = edge * (1.0 - 1e-6);
  Guess guess;
  guess.becomes = stepped(step);
  guess.added.term = curve_on_command({-edge, before}, {edge, -before}, step);
  guess.added.words = "steps of " + amperes(step);
  return guess;
}

/// A wave about a level: its parts by least squares, and the squares that it leaves.
struct Wave {
  double level = 0.0, cosine = 0.0, sine = 0.0, left = 0.0;
};
Wave wave_at(const LawSeries& series, double frequency) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < series.time.size(); ++i) {
    const double angle = 2.0 * std::numbers::pi * frequency * series.time[i];
    const Eigen::Vector3d row{1.0, std::cos(angle), std::sin(angle)};
    normal += row * row.transpose(), right += series.beyond[i] * row;
  }
  const Eigen::Vector3d parts = numerics::solve_symmetric(normal, right);
  return {parts(0), parts(1), parts(2), series.squares - parts.dot(right)};
}
Wave square_at(const LawSeries& series, double frequency, double phase) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < series.time.size(); ++i) {
    const double angle = 2.0 * std::numbers::pi * frequency * series.time[i] + phase;
    const Eigen::Vector2d row{1.0, std::sin(angle) >= 0.0 ? 1.0 : -1.0};
    normal += row * row.transpose(), right += series.beyond[i] * row;
  }
  const Eigen::Vector2d parts = numerics::solve_symmetric(normal, right);
  return {parts(0), 0.0, parts(1), series.squares - parts.dot(right)};
}

/// Half a cycle of the whole recording to each side.
std::vector<double> about(double frequency, const LawSeries& series) {
  const double lasts = series.time.back() - series.time.front();
  return evenly(frequency - 0.5 / lasts, frequency + 0.5 / lasts, 0.05 / lasts);
}

enum class Form { sine, square };

Guess from_wave(const LawSeries& series, const Wave& wave, double frequency, double phase, Form form,
                bool has_level) {
  const bool is_square = form == Form::square;
  const double half = std::numbers::pi * frequency * (series.time[1] - series.time[0]);
  const double amplitude = std::hypot(wave.cosine, wave.sine);
  Guess guess;
  guess.left = wave.left, guess.numbers = 4.0;
  auto& term = guess.added.term = started("additive_disturbance");
  const auto put = [&](const char* name, double value) { term.values[term.info->index_of(name)] = value; };
  // A row is the mean over its cycle, the term speaks of its beginning.
  put("amplitude", is_square ? amplitude : amplitude * half / std::sin(half));
  put("frequency", frequency);
  put("phase", std::remainder(phase - half, 2.0 * std::numbers::pi));
  put("squareness", is_square ? 1.0 : 0.0);
  if (has_level) put("offset", wave.level);
  guess.added.words =
      (is_square ? "a square wave of " : "a sine of ") + amperes(amplitude) + " at " + si(frequency, "Hz") +
      (has_level && std::abs(wave.level) > 0.1 * amplitude ? " about " + amperes(wave.level) : std::string{});
  return guess;
}

Guess sine(const LawSeries& series, double near, bool has_level) {
  const auto left = [&](double frequency) { return wave_at(series, frequency).left; };
  const double frequency = least_of(about(near, series), left);
  const auto wave = wave_at(series, frequency);
  return from_wave(series, wave, frequency, std::atan2(wave.cosine, wave.sine), Form::sine, has_level);
}

Guess square(const LawSeries& series, double near, double phase, bool has_level) {
  // Frequency and phase in turn: about the middle of the recording the two do not lean on each other.
  const double middle = 0.5 * (series.time.front() + series.time.back());
  double frequency = near, turn = phase + 2.0 * std::numbers::pi * near * middle;
  const auto phase_of = [&](double f, double at_middle) {
    return at_middle - 2.0 * std::numbers::pi * f * middle;
  };
  for (int again = 0; again < 3; ++again) {
    const double reach = again == 0 ? std::numbers::pi : 0.2;
    turn = least_of(evenly(turn - reach, turn + reach, reach / 20.0),
                    [&](double t) { return square_at(series, frequency, phase_of(frequency, t)).left; });
    frequency = least_of(about(frequency, series),
                         [&](double f) { return square_at(series, f, phase_of(f, turn)).left; });
  }
  phase = phase_of(frequency, turn);
  auto wave = square_at(series, frequency, phase);
  if (wave.sine < 0.0) wave.sine = -wave.sine, phase += std::numbers::pi;
  return from_wave(series, wave, frequency, phase, Form::square, has_level);
}

/// Of the longest recording, whose rows without a word of the law count as its mean.
std::vector<Guess> waves(const Case& data, const std::vector<LawRows>& law, const LawSeries& series,
                         bool has_level) {
  std::size_t longest = 0;
  for (std::size_t r = 1; r < law.size(); ++r)
    if (law[r].beyond.size() > law[longest].beyond.size()) longest = r;
  auto beyond = law[longest].beyond;
  double sum = 0.0, rows = 0.0;
  for (const double b : beyond)
    if (std::isfinite(b)) sum += b, rows += 1.0;
  for (double& b : beyond) b = std::isfinite(b) ? b - sum / rows : 0.0;
  const auto lines = lines_of(data.recordings[longest].inputs.time, beyond, {{1.0}});
  std::vector<Guess> all;
  // Beside the right place a wave wins less, but not by far.
  const auto rows_of_all = static_cast<double>(series.time.size());
  const auto pays = [&](const Wave& wave) {
    return 0.5 * rows_of_all * std::log(series.squares / wave.left) > 0.3 * thresholds::added_gain;
  };
  for (const double frequency : lines.frequency)
    if (pays(wave_at(series, frequency))) all.push_back(sine(series, frequency, has_level));
  for (const auto& [frequency, phase] : lines.squares)
    if (pays(square_at(series, frequency, phase))) all.push_back(square(series, frequency, phase, has_level));
  return all;
}

/// Does the current stay at a limit while the command goes beyond it?
bool stays_at(const std::vector<LawRows>& law, double limit) {
  double current = 0.0, command = 0.0, rows = 0.0;
  for (const auto& one : law)
    for (std::size_t i = 0; i < one.asked.size(); ++i)
      if (const double asked = std::abs(one.asked[i]); asked > limit) {
        current += std::pow(std::abs(one.asked[i] + one.beyond[i]) - limit, 2.0);
        command += std::pow(asked - limit, 2.0), rows += 1.0;
      }
  return rows > thresholds::limited_rows && current < thresholds::limited_far_less * command;
}

/// Does what a kind makes of the command stand in the current where the command is as the model expects it? Readings that the
/// controller did not see make much of a command, and what is left of it goes with them. Limits and steps show in the current
/// itself.
bool stands_without_noise(const Case& data, const std::vector<LawRows>& law, const Guess& guess) {
  if (!guess.becomes) return true;
  const auto& curve = guess.added.term.curve;
  if (curve.knots.size() == 4) return stays_at(law, curve.knots[2]);
  const auto place = std::find(data.outputs.begin(), data.outputs.end(), "current") - data.outputs.begin();
  const auto simulated = simulate(data, data.model);
  const double step = curve.period;
  double seen = 0.0, expected = 0.0, off = 0.0, rows = 0.0;
  for (std::size_t r = 0; r < law.size(); ++r)
    for (std::size_t i = 0; i < law[r].asked.size(); ++i) {
      const double asked = law[r].asked[i], beyond = law[r].beyond[i],
                   model = simulated[r][static_cast<std::size_t>(place)][i],
                   does = guess.becomes(model) - model;
      if (!std::isfinite(asked)) continue;
      seen += does * beyond, expected += does * (guess.becomes(asked) - asked);
      if (step > 0.0) off += std::pow(std::remainder(asked + beyond, step) / step, 2.0), rows += 1.0;
    }
  // Of values anywhere between two steps the RMS distance from the nearer is 0.29 steps.
  return step > 0.0 ? std::sqrt(off / rows) < thresholds::nearer_to_steps
                    : seen > thresholds::added_at_least * expected && expected > 0.0;
}

}  // namespace

namespace {

/// All kinds that are seen row by row, what leaves least first.
std::vector<Guess> guesses_of(const Case& data, const std::vector<LawRows>& law, const LawSeries& series) {
  const auto& settings = *data.model.controller;
  const bool has_level =
      settings.kind == physics::AxisControllerSettings::Kind::cascade || !(settings.ki > 0.0);
  std::vector<Guess> all = waves(data, law, series, has_level);
  if (has_level) all.push_back(offset(series));
  all.push_back(limit(series));
  const auto much = asked_much(series);
  all.push_back(dead_zone(much));
  if (auto stepped = steps(much)) all.push_back(std::move(*stepped));
  for (auto& guess : all)
    if (guess.becomes) guess.left = left_by(series, guess.becomes);
  const auto rows = static_cast<double>(series.time.size());
  const auto cost = [&](const Guess& guess) {
    return 0.5 * rows * std::log(guess.left) + 0.5 * guess.numbers * std::log(rows);
  };
  std::sort(all.begin(), all.end(), [&](const Guess& a, const Guess& b) { return cost(a) < cost(b); });
  return all;
}

}  // namespace

std::optional<Added> added_to_command(const Case& data, const std::vector<LawRows>& law) {
  if (law.empty()) return std::nullopt;
  const auto series = series_of(data, law);
  double asked = 0.0;
  for (const double u : series.asked) asked += u * u;
  if (series.time.size() < thresholds::fewest_rows_of_law ||
      !(series.squares > thresholds::current_rounding * asked))
    return std::nullopt;
  const auto rows = static_cast<double>(series.time.size());
  for (auto& guess : guesses_of(data, law, series)) {
    const double noise = std::min(guess.left, rows * series.noise * series.noise),
                 won = series.squares - guess.left, gain = 0.5 * rows * std::log(series.squares / guess.left);
    guess.added.share = won / (series.squares - noise);
    if (!(gain > thresholds::added_gain)) break;
    if (!(guess.added.share > thresholds::added_explains) || !stands_without_noise(data, law, guess))
      continue;
    const auto law_off = off_the_law(data);
    const double goes_with_motion = law_off ? rows * law_off->off * law_off->off : 0.0;
    // Another law leaves less of what it does than a kind that follows the motion by chance.
    if (guess.left - noise < 0.5 * (series.squares - goes_with_motion - noise)) return guess.added;
  }
  return comes_late_from_law(data, law);
}

double felt_by_carriage(const Case& data, const std::vector<LawRows>& law) {
  const auto at = std::find(data.outputs.begin(), data.outputs.end(), "position") - data.outputs.begin();
  const auto told_case = told_what_law_leaves(data, law);
  const auto told = simulate(told_case, data.model), untold = simulate(data, data.model);
  double with = 0.0, both = 0.0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto place = static_cast<std::size_t>(at);
    for (std::size_t i = 0; i < told[r][place].size(); ++i) {
      const double does = told[r][place][i] - untold[r][place][i],
                   left = data.recordings[r].measured[place][i] - untold[r][place][i];
      if (std::isfinite(left)) with += does * does, both += does * left;
    }
  }
  return with > 0.0 ? both / with : 0.0;
}

void settle_recorded_current(Case& data) {
  if (data.model.plant != physics::Plant::axis || !data.model.controller) return;
  const auto law = rows_of_law(data);
  const auto added = added_to_command(data, law);
  if (!added) return;
  const double felt = felt_by_carriage(data, law);
  if (felt < thresholds::added_is_felt) {
    // What the controller read otherwise than was recorded looks like much of the command, but not like a wave.
    const bool is_surely_there = added->term.curve.over == "time" || added->term.info->is_wave_in_time();
    if (!is_surely_there) return;
    data.doubts.push_back(
        "column `" + data.model.signal("current")->column + "` reads " + added->words +
        " beside what the controller makes of the recorded reference and position, which the carriage "
        "does not feel: look at how the current is measured");
    return;
  }
  data.beside_law = added->term;
  if (std::exchange(data.model.records_applied, true)) return;
  data.remembered = std::make_shared<Remembered>();
  for (auto& recording : data.recordings)
    recording.simulation = physics::prepare(data.model, recording.inputs);
  data.doubts.push_back(
      "column `" + data.model.signal("current")->column + "` holds " + added->words +
      " beside what the controller makes of the recorded reference and position: it is taken to be "
      "recorded behind what acts between controller and motor (`current: applied`)");
}

}  // namespace invar::diagnosis
