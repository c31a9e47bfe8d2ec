#include "tools/diagnose/misrecorded.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/fault.hpp"
#include "core/physics/equations_columns.hpp"
#include "tools/diagnose/candidates.hpp"
#include "tools/diagnose/odds.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

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

/// The squares of what was measured `rows` earlier than it is simulated; over the same rows for each number of them up to
/// `most`.
double squares_when_later(const Case& data, const std::vector<physics::Outputs>& simulated,
                          std::size_t output, std::size_t rows, std::size_t most) {
  double sum = 0.0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& measured = data.recordings[r].measured[output];
    for (std::size_t i = 0; i + most < measured.size(); ++i)
      if (std::isfinite(measured[i])) sum += std::pow(measured[i] - simulated[r][output][i + rows], 2);
  }
  return sum;
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
                     report::number(record.time[from], 4) + " s on and is left out there: its sensor died");
  }
  for (const auto& [values, from] : died)
    std::fill(values->begin() + static_cast<std::ptrdiff_t>(from), values->end(), std::nan(""));
}

std::optional<Case> with_columns_in_step(const Case& as_read, const Case& judged, const Diagnosis& d) {
  if (!judged.is_time_series || d.is_partial) return std::nullopt;
  std::optional<Case> moved;
  // A retuned model's numbers may have been bent to cover what comes early.
  const auto retuned = simulate(judged, d.retuned.model), best = simulate(judged, d.best.model),
             believed = simulate(judged, judged.model);
  for (std::size_t o = 0; o < judged.outputs.size(); ++o) {
    constexpr std::size_t most = 20;
    constexpr double far_less = 0.25;  // of the squares
    const auto when_later = [&](std::size_t rows) {
      return std::min(squares_when_later(judged, retuned, o, rows, most),
                      squares_when_later(judged, believed, o, rows, most));
    };
    std::size_t rows = 0;
    double least = far_less * std::min(when_later(0), squares_when_later(judged, best, o, 0, most));
    for (std::size_t later = 1; later <= most; ++later)
      if (const double left = when_later(later); left < least) least = left, rows = later;
    if (rows == 0 || rows == most) continue;  // at the end of what was tried it is no minimum
    if (!moved) moved = as_read, moved->remembered = std::make_shared<Remembered>();
    moved->moved.push_back(o);
    for (auto& recording : moved->recordings) {
      auto& measured = recording.measured[o];
      const std::size_t by = std::min(rows, measured.size());
      std::rotate(measured.begin(), measured.end() - static_cast<std::ptrdiff_t>(by), measured.end());
      std::fill_n(measured.begin(), by, std::nan(""));
    }
    const auto& time =
        judged.recordings.front().inputs.time;  // of 8 rows at least, and perhaps of fewer than `most`
    const double step = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
    moved->doubts.push_back("column `" + judged.model.signal(judged.outputs[o])->column + "` comes " +
                            std::to_string(rows) + (rows == 1 ? " row (" : " rows (") +
                            report::si(static_cast<double>(rows) * step, "s", 2) +
                            ") too early beside the others and was moved: look at how the columns were put "
                            "together");
  }
  return moved;
}

bool comes_late_again(const Case& moved, const Diagnosis& d) {
  return std::any_of(d.findings.begin(), d.findings.end(), [&](const Finding& finding) {
    const bool is_late = comes_late(finding.term) || finding.term.info->name == "hidden_state";
    if (moved.model.plant != physics::Plant::equations) return is_late;
    return is_late && std::any_of(moved.moved.begin(), moved.moved.end(), [&](std::size_t o) {
             return finding.term.on == physics::place_of_output(moved.model.equations, moved.outputs[o]);
           });
  });
}

}  // namespace invar::diagnose
