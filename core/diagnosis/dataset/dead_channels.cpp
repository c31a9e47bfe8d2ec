#include "core/diagnosis/dataset/dead_channels.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/quantity.hpp"

namespace invar::diagnosis {

namespace {

constexpr std::size_t enough_rows = 50;  // to say that a column stands still

bool moves_from_row_to_row(physics::Plant plant) {
  return plant == physics::Plant::axis || plant == physics::Plant::thermal ||
         plant == physics::Plant::equations;
}

/// Does every row that has a number have the same one?
bool is_dead(const Case& data, std::size_t output) {
  double low = 0.0, high = 0.0;
  std::size_t rows = 0;
  for (const auto& recording : data.recordings)
    for (const double v : recording.measured[output])
      if (std::isfinite(v)) {
        low = rows == 0 ? v : std::min(low, v), high = rows == 0 ? v : std::max(high, v);
        ++rows;
      }
  return rows >= enough_rows && low == high;
}

/// From where on a column reads one value to the end, though it hardly ever read one twice before and has been on either
/// side of it; its length where it goes on.
std::size_t still_from(const std::vector<double>& values) {
  std::vector<std::size_t> read;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i])) read.push_back(i);
  std::size_t from = read.size();
  while (from > 0 && values[read[from - 1]] == values[read.back()]) --from;
  if (from < enough_rows || read.size() - from < enough_rows) return values.size();
  std::size_t still = 0, above = 0, below = 0;
  for (std::size_t i = 0; i < from; ++i) {
    still += i > 0 && values[read[i]] == values[read[i - 1]] ? 1U : 0U;
    ++(values[read[i]] > values[read.back()] ? above : below);
  }
  constexpr std::size_t one_of = 100;
  return one_of * still > from || above == 0 || below == 0 ? values.size() : read[from];
}

/// Does another signal read more than one value from this row on?
bool goes_on(const physics::Record& record, const std::string& but, std::size_t from) {
  return std::any_of(record.signals.begin(), record.signals.end(), [&](const auto& signal) {
    double first = std::nan("");
    for (std::size_t i = from; signal.first != but && i < signal.second.size(); ++i) {
      const double v = signal.second[i];
      if (std::isfinite(first) && std::isfinite(v) && v != first) return true;
      if (!std::isfinite(first)) first = v;
    }
    return false;
  });
}

}  // namespace

void leave_out_dead(Case& data, const std::filesystem::path& file) {
  if (!moves_from_row_to_row(data.model.plant)) return;
  std::vector<std::size_t> dead;
  for (std::size_t o = 0; o < data.outputs.size(); ++o)
    if (is_dead(data, o)) dead.push_back(o);
  for (const std::size_t o : dead) {
    const auto& column = data.model.signal(data.outputs[o])->column;
    if (dead.size() == data.outputs.size())
      throw InputError{file.string() + ": column `" + column + "`", "reads one value in every row",
                       "look at its sensor, and record the machine moving"};
    data.doubts.push_back(
        "column `" + column +
        "` reads one value in every row and is left out: its sensor is dead, or nothing moved");
    for (auto& recording : data.recordings) {
      auto& measured = recording.measured[o];
      if (data.model.plant == physics::Plant::axis && recording.inputs.signals.erase(data.outputs[o]) > 0)
        recording.simulation =
            physics::prepare(data.model, recording.inputs);  // it starts where it is told to
      const auto first =
          std::find_if(measured.begin(), measured.end(), [](double v) { return std::isfinite(v); });
      if (first != measured.end()) std::fill(first + 1, measured.end(), std::nan(""));
    }
  }
}

void leave_out_what_died(const physics::Model& model, physics::Record& record, const std::string& file,
                         std::vector<std::string>& doubts) {
  if (!moves_from_row_to_row(model.plant)) return;
  std::vector<std::pair<std::vector<double>*, std::size_t>> died;
  for (const auto& signal : model.signals) {
    const auto at = record.signals.find(signal.name);
    if (!signal.is_output || at == record.signals.end()) continue;
    const std::size_t from = still_from(at->second);
    if (from == at->second.size() || !goes_on(record, signal.name, from)) continue;
    died.emplace_back(&at->second, from + 1);
    doubts.push_back(file + ": column `" + signal.column + "` reads one value from " +
                     number(record.time[from], 4) + " s on and is left out there: its sensor died");
  }
  for (const auto& [values, from] : died)
    std::fill(values->begin() + static_cast<std::ptrdiff_t>(from), values->end(), std::nan(""));
}

}  // namespace invar::diagnosis
