#include "tools/diagnose/clock.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/diagnose/statistics.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

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

/// RMS of measured - simulated by output, each over the spread of what was measured.
std::vector<double> missed(const Recording& recording, const physics::Outputs& simulated) {
  std::vector<double> by_output;
  for (std::size_t o = 0; o < simulated.size(); ++o) {
    double off = 0.0, sum = 0.0, squares = 0.0, n = 0.0;
    for (std::size_t i = 0; i < simulated[o].size(); ++i) {
      const double y = recording.measured[o][i];
      if (!std::isfinite(y)) continue;
      off += std::pow(y - simulated[o][i], 2), sum += y, squares += y * y, n += 1.0;
    }
    if (n < 8.0) continue;
    const double spread = squares / n - std::pow(sum / n, 2);
    by_output.push_back(spread > 0.0 ? std::sqrt(off / n / spread) : 0.0);
  }
  return by_output;
}

}  // namespace

void check_ticks(const physics::Model& model, const std::vector<double>& time,
                 const std::filesystem::path& file) {
  if (!model.controller || time.size() < 3) return;
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  const double step = median(std::move(steps)), ticks = step * model.controller->rate;
  if (ticks > 0.1 && ticks < 200.0) return;
  throw InputError{file.string() + ": column `" + model.signal("time")->column + "`",
                   "has rows " + report::si(step, "s") + " apart, the model's controller has a period of " +
                       report::si(1.0 / model.controller->rate, "s"),
                   "write the unit of the time into its header, such as `" + model.signal("time")->column +
                       " [ms]`, or the loop's rate into `controller`"};
}

void check_clock(const Case& data) {
  if (!data.is_time_series || data.model.controller || data.model.plant == physics::Plant::error_map ||
      !is_believed(data.model))
    return;
  for (const auto& recording : data.recordings) {
    physics::Outputs simulated;
    recording.simulation->run(data.model, simulated);
    const auto as_read = missed(recording, simulated);
    if (as_read.empty()) continue;
    for (const auto& clock : clocks) {
      auto inputs = recording.inputs;
      for (double& t : inputs.time) t *= clock.factor;
      physics::prepare(data.model, inputs)->run(data.model, simulated);
      const auto otherwise = missed(recording, simulated);
      double worst = 0.0;
      for (std::size_t o = 0; o < as_read.size(); ++o)
        worst = std::max(worst, std::isfinite(otherwise[o]) && as_read[o] > 0.0
                                    ? std::max(otherwise[o], otherwise[o] / as_read[o])
                                    : 1.0);
      if (!(worst < 0.2)) continue;
      const auto& column = data.model.signal("time")->column;
      const auto header = [&](const char* unit) { return "`" + column + " [" + unit + "]`"; };
      throw InputError{recording.name + ": column `" + column + "`",
                       std::string{"the model would follow the recording were the time "} + clock.words,
                       "write the true unit into the header, such as " + header(clock.true_unit) + " for " +
                           header(clock.read_as) + ", or mend the units of the model's numbers"};
    }
  }
}

}  // namespace invar::diagnose
