#include "core/diagnosis/dataset/gap_bridging.hpp"
#include "core/diagnosis/dataset/statistics.hpp"

#include <algorithm>
#include <cmath>

namespace invar::diagnosis {

namespace {

/// The reference at `t` by the cubic through the values and slopes on both sides of the gap before row `i`.
double across(const physics::Record& inputs, const std::vector<double>& values, std::size_t i, double t) {
  const auto& time = inputs.time;
  const double h = time[i] - time[i - 1], s = (t - time[i - 1]) / h;
  const double before = i > 1 ? (values[i - 1] - values[i - 2]) / (time[i - 1] - time[i - 2]) * h : 0.0;
  const double after =
      i + 1 < values.size() ? (values[i + 1] - values[i]) / (time[i + 1] - time[i]) * h : 0.0;
  const double d = values[i] - values[i - 1];
  return values[i - 1] + s * (before + s * (3.0 * d - 2.0 * before - after + s * (before + after - 2.0 * d)));
}

}  // namespace

void bridge_gaps(const physics::Model& model, Recording& recording, double step) {
  constexpr double longest_bridge = 500.0, until_forgotten = 300.0;  // rows
  auto& inputs = recording.inputs;
  const auto reference = physics::bridged(inputs.time, inputs.signals.at("reference"));
  physics::Record whole;
  std::vector<std::size_t> place;  // of each row among those of `whole`
  for (std::size_t i = 0; i < inputs.rows(); ++i) {
    const double gap = i > 0 ? inputs.time[i] - inputs.time[i - 1] : 0.0;
    if (gap > longest_bridge * step)  // a pause: the loop starts anew behind it
      for (std::size_t k = i; k < inputs.rows() && inputs.time[k] < inputs.time[i] + until_forgotten * step;
           ++k)
        for (auto& values : recording.measured) values[k] = no_reading;
    else if (gap > 2.5 * step)
      for (double t = inputs.time[i - 1] + step; t < inputs.time[i] - 0.5 * step; t += step) {
        whole.time.push_back(t);
        whole.signals["reference"].push_back(across(inputs, reference, i, t));
      }
    place.push_back(whole.time.size());
    whole.time.push_back(inputs.time[i]);
    whole.signals["reference"].push_back(reference[i]);
  }
  if (whole.time.size() == inputs.rows()) return;
  const auto spread_out = [&](const std::vector<double>& values) {
    std::vector<double> all(whole.time.size(), no_reading);
    for (std::size_t i = 0; i < place.size(); ++i) all[place[i]] = values[i];
    return all;
  };
  for (const auto& [name, values] : inputs.signals)
    if (name != "reference") whole.signals[name] = spread_out(values);
  std::vector<std::vector<double>> measured;
  for (const auto& values : recording.measured) measured.push_back(spread_out(values));
  std::shared_ptr<const physics::Simulation> by_cubic = physics::prepare(model, whole);
  physics::Outputs straight, cubic;
  recording.simulation->run(model, straight);
  by_cubic->run(model, cubic);
  for (std::size_t o = 0; o < measured.size(); ++o) {
    // The cubic is nearer than the line by far; a fifth of what parts them is a fair bound of its own error.
    const double noise = spread_of_differences(recording.measured[o]);
    for (std::size_t i = 0; i < place.size(); ++i)
      if (!(0.2 * std::abs(cubic[o][place[i]] - straight[o][i]) < 0.3 * noise))
        for (auto& values : measured) values[place[i]] = no_reading;
  }
  recording.inputs = std::move(whole);
  recording.measured = std::move(measured);
  recording.simulation = std::move(by_cubic);
}

}  // namespace invar::diagnosis
