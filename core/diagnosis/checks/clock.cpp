#include "core/diagnosis/checks/clock.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/fault.hpp"
#include "core/base/quantity.hpp"
#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/estimate/fit_comparison.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

struct Clock {
  double factor;  // true seconds in what was read as one
  const char *words, *true_unit, *read_as;
};
constexpr std::array clocks{
    Clock{1e-3, "1000 times shorter", "ms", "s"}, Clock{1e3, "1000 times longer", "s", "ms"},
    Clock{60.0, "60 times longer", "min", "s"},   Clock{1.0 / 60.0, "60 times shorter", "s", "min"},
    Clock{3600.0, "3600 times longer", "h", "s"}, Clock{1.0 / 3600.0, "3600 times shorter", "s", "h"}};

bool is_believed(const physics::Model& model) {
  return !model.parameters.empty() &&
         std::all_of(model.parameters.begin(), model.parameters.end(), [](const physics::Parameter& p) {
           return p.sigma && (p.value == 0.0 || *p.sigma <= 0.5 * std::abs(p.value));
         });
}

/// The sum of squares of measured - simulated over these rows, those that are measured; infinite where the model runs away.
double squares_off(const std::vector<double>& measured, const std::vector<double>& simulated) {
  double sum = 0.0;
  for (std::size_t i = 0; i < simulated.size(); ++i)
    if (std::isfinite(measured[i])) sum += std::pow(measured[i] - simulated[i], 2);
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

/// By output, the squares that a model may leave which follows the recording, where as read it leaves those of `as_read`.
/// Empty: too little is measured to say.
std::vector<double> followed_by(const Recording& recording, const physics::Outputs& as_read) {
  std::vector<double> most(as_read.size(), std::numeric_limits<double>::infinity());
  bool any = false;
  for (std::size_t o = 0; o < most.size(); ++o) {
    double sum = 0.0, squares = 0.0, n = 0.0;
    for (const double y : recording.measured[o])
      if (std::isfinite(y)) sum += y, squares += y * y, n += 1.0;
    if (n < 8.0) continue;
    any = true;
    most[o] = thresholds::follows_share * thresholds::follows_share *
              std::min(squares - sum * sum / n, squares_off(recording.measured[o], as_read[o]));
  }
  return any ? most : std::vector<double>{};
}

/// Does the model leave less than `most` were the time multiplied? A wrong clock shows within a few rows, and hours in steps of
/// a millisecond take long: more and more rows are run through while it does not.
bool follows(const Case& data, const Recording& recording, double factor, const std::vector<double>& most) {
  const std::size_t n = recording.inputs.rows();
  for (std::size_t rows = std::min<std::size_t>(n, 16);; rows = std::min(n, 2 * rows)) {
    auto inputs = recording.inputs;
    inputs.time.resize(rows);
    for (double& t : inputs.time) t *= factor;
    for (auto& [name, values] : inputs.signals) values.resize(rows);
    physics::Outputs simulated;
    physics::prepare(data.model, inputs)->run(data.model, simulated);
    for (std::size_t o = 0; o < most.size(); ++o)
      if (!(squares_off(recording.measured[o], simulated[o]) < most[o]) && std::isfinite(most[o]))
        return false;
    if (rows == n) return true;
  }
}

[[noreturn]] void refuse(const Case& data, const Recording& recording, const Clock& clock) {
  const auto& column = data.model.signal("time")->column;
  if (data.model.row_rate)
    throw InputError{recording.name, std::string{"the model would follow it were the time "} + clock.words,
                     "mend `rate` under `columns`: it is in Hz, or `{value: 100, unit: ...}`"};
  const auto header = [&](const char* unit) { return "`" + column + " [" + unit + "]`"; };
  throw InputError{recording.name + ": column `" + column + "`",
                   std::string{"the model would follow the recording were the time "} + clock.words,
                   "write the true unit into the header, such as " + header(clock.true_unit) + " for " +
                       header(clock.read_as) + ", or mend the units of the model's numbers"};
}

/// What the user's own equations leave of a recording once their numbers have given way, and how far these went.
struct Retuned {
  double left = 0.0;       // RMS over spread, of the output that is followed worst
  double excursion = 0.0;  // [sigmas of what was believed]
};

/// Were the time multiplied: of the first rows, which are enough to know a clock by.
Retuned retuned(const Case& data, const Recording& recording, double factor) {
  Case some = data;
  some.remembered = std::make_shared<Remembered>();
  some.recordings = {recording};
  auto& [name, inputs, measured, simulation] = some.recordings.front();
  const std::size_t rows = std::min(thresholds::rows_of_a_clock, inputs.rows());
  inputs.time.resize(rows);
  for (double& t : inputs.time) t *= factor;
  for (auto& [signal, values] : inputs.signals) values.resize(rows);
  for (auto& column : measured) column.resize(rows);
  simulation = physics::prepare(some.model, inputs);
  auto found = fit(some, weigh(some, simulate(some, some.model), Colour::white), some.model, some.model,
                   Effort::follow(8));
  found = fit(some, weigh(some, simulate(some, found.model), Colour::white), found.model, some.model,
              Effort::follow(8));
  const auto simulated = simulate(some, found.model);
  Retuned all{0.0, excursion_of(found)};
  for (std::size_t o = 0; o < measured.size(); ++o) {
    double sum = 0.0, squares = 0.0, n = 0.0;
    for (const double y : measured[o])
      if (std::isfinite(y)) sum += y, squares += y * y, n += 1.0;
    if (n < 8.0) continue;
    all.left = std::max(all.left, std::sqrt(squares_off(measured[o], simulated[0][o]) /
                                            std::max(1e-300, squares - sum * sum / n)));
  }
  return all;
}

/// Numbers that are a little off, or of which the user is less sure, may hide a wrong clock: they are let give way. Refused is a time
/// that the model follows with the numbers near what is believed, where as read it does not, or only with others.
void check_retuned_clock(const Case& data) {
  const auto& parameters = data.model.parameters;
  if (data.model.plant != physics::Plant::equations || data.model.equations.states.empty() ||
      !data.model.equations.controlled_input.empty() ||
      !std::all_of(parameters.begin(), parameters.end(), [](const auto& p) { return p.sigma.has_value(); }))
    return;
  const auto& recording = data.recordings.front();
  const auto as_read = retuned(data, recording, 1.0);
  if (as_read.left < thresholds::follows_share_retuned && as_read.excursion <= thresholds::far_astray) return;
  for (const auto& clock : clocks) {
    if (clock.factor != 1e3 && clock.factor != 1e-3) continue;  // less is within what a number may be off
    const auto other = retuned(data, recording, clock.factor);
    const bool is_nearer = as_read.left > thresholds::clock_times_worse * other.left &&
                           other.excursion <= thresholds::far_astray,
               is_likelier =
                   as_read.excursion > thresholds::far_astray && other.excursion <= thresholds::near_sigmas;
    if (other.left < thresholds::follows_share_retuned && (is_nearer || is_likelier))
      refuse(data, recording, clock);
  }
}

}  // namespace

void check_clock(const Case& data) {
  if (data.is_time_series) check_retuned_clock(data);
  if (!data.is_time_series || data.model.controller || data.model.plant == physics::Plant::error_map ||
      !is_believed(data.model))
    return;
  for (const auto& recording : data.recordings) {
    physics::Outputs as_read;
    recording.simulation->run(data.model, as_read);
    const auto most = followed_by(recording, as_read);
    if (most.empty()) continue;
    for (const auto& clock : clocks) {
      if (!follows(data, recording, clock.factor, most)) continue;
      refuse(data, recording, clock);
    }
  }
}

}  // namespace invar::diagnosis
