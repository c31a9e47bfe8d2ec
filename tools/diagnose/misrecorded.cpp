#include "tools/diagnose/misrecorded.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/fault.hpp"
#include "tools/diagnose/candidates.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

namespace {

/// Does every row that has a number have the same one?
bool is_dead(const Case& data, std::size_t output) {
  constexpr std::size_t enough = 50;  // rows
  double low = 0.0, high = 0.0;
  std::size_t rows = 0;
  for (const auto& recording : data.recordings)
    for (const double v : recording.measured[output])
      if (std::isfinite(v)) {
        low = rows == 0 ? v : std::min(low, v), high = rows == 0 ? v : std::max(high, v);
        ++rows;
      }
  return rows >= enough && low == high;
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
  const auto plant = data.model.plant;
  if (plant != physics::Plant::axis && plant != physics::Plant::thermal && plant != physics::Plant::equations)
    return;
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
      const auto first =
          std::find_if(measured.begin(), measured.end(), [](double v) { return std::isfinite(v); });
      if (first != measured.end()) std::fill(first + 1, measured.end(), std::nan(""));
    }
  }
}

std::vector<std::string> misrecorded(const Case& data, const Diagnosis& d) {
  std::vector<std::string> clauses;
  if (!data.is_time_series) return clauses;
  // A retuned model's numbers may have been bent to cover what comes early.
  const auto retuned = simulate(data, d.retuned.model), best = simulate(data, d.best.model),
             believed = simulate(data, data.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    constexpr std::size_t most = 20;
    constexpr double far_less = 0.25;  // of the squares
    const auto when_later = [&](std::size_t rows) {
      return std::min(squares_when_later(data, retuned, o, rows, most),
                      squares_when_later(data, believed, o, rows, most));
    };
    std::size_t rows = 0;
    double least = far_less * std::min(when_later(0), squares_when_later(data, best, o, 0, most));
    for (std::size_t later = 1; later <= most; ++later)
      if (const double left = when_later(later); left < least) least = left, rows = later;
    if (rows == 0) continue;
    const auto& time =
        data.recordings.front().inputs.time;  // of 8 rows at least, and perhaps of fewer than `most`
    const double step = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
    clauses.push_back("column `" + data.model.signal(data.outputs[o])->column + "` comes " +
                      std::to_string(rows) + (rows == 1 ? " row (" : " rows (") +
                      report::si(static_cast<double>(rows) * step, "s", 2) +
                      ") too early beside the others: look at how the columns were put together");
  }
  return clauses;
}

}  // namespace invar::diagnose
