#include "core/diagnosis/dataset/lone_inputs.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

namespace {

/// Rows far beyond all others; none where that is said of more than a few, or where the others are all the same.
std::vector<std::size_t> far_beyond(const std::vector<double>& values) {
  constexpr std::size_t most = 3, enough = 20;
  constexpr double widths = 3.0;
  std::vector<double> sorted;
  for (const double v : values)
    if (std::isfinite(v)) sorted.push_back(v);
  if (sorted.size() < enough) return {};
  std::sort(sorted.begin(), sorted.end());
  const double low = sorted[most], high = sorted[sorted.size() - 1 - most], width = high - low;
  if (!(width > 0.0)) return {};
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] > high + widths * width || values[i] < low - widths * width) rows.push_back(i);
  if (rows.size() > most) rows.clear();
  return rows;
}

/// Sum of squares of measured - simulated, by output, of the model as it is believed.
std::vector<double> squares_of(const physics::Model& model, const physics::Record& record,
                               const std::vector<std::string>& outputs) {
  auto inputs = record;
  for (const auto& output : outputs) inputs.signals.erase(output);
  physics::Outputs simulated;
  physics::prepare(model, inputs)->run(model, simulated);
  std::vector<double> sums;
  for (std::size_t o = 0; o < outputs.size(); ++o) {
    const auto& measured = record.signals.at(outputs[o]);
    double sum = 0.0;
    for (std::size_t i = 0; i < measured.size(); ++i)
      if (std::isfinite(measured[i])) sum += std::pow(measured[i] - simulated[o][i], 2);
    sums.push_back(sum);
  }
  return sums;
}

/// Does the model come nearer to one output, and to none less near?
bool is_nearer(const std::vector<double>& without, const std::vector<double>& with) {
  constexpr double plainly = 0.9;
  bool any = false;
  for (std::size_t o = 0; o < with.size(); ++o) {
    if (without[o] > with[o] / plainly) return false;
    any = any || without[o] < plainly * with[o] || (std::isfinite(without[o]) && !std::isfinite(with[o]));
  }
  return any;
}

}  // namespace

std::size_t drop_lone_inputs(const physics::Model& model, physics::Record& record) {
  const auto outputs = model.outputs();
  const bool is_row_by_row =
      model.plant == physics::Plant::error_map || model.plant == physics::Plant::droplet;
  std::vector<double> with;
  std::size_t dropped = 0;
  for (auto& [name, values] : record.signals) {
    if (std::find(outputs.begin(), outputs.end(), name) != outputs.end()) continue;
    auto rows = far_beyond(values);
    if (model.plant == physics::Plant::droplet && name == "height")  // no drop flies up
      for (std::size_t i = 0; i < values.size(); ++i)
        if (values[i] <= 0.0 && std::find(rows.begin(), rows.end(), i) == rows.end()) rows.push_back(i);
    for (const std::size_t row : rows) {
      const double kept = std::exchange(values[row], no_reading);
      if (is_row_by_row) {
        for (const auto& output : outputs) record.signals.at(output)[row] = no_reading;
        ++dropped;
        continue;
      }
      values[row] = kept;
      if (with.empty()) with = squares_of(model, record, outputs);
      values[row] = no_reading;
      if (auto without = squares_of(model, record, outputs); is_nearer(without, with)) {
        with = std::move(without);
        ++dropped;
      } else {
        values[row] = kept;
      }
    }
  }
  return dropped;
}

}  // namespace invar::diagnosis
