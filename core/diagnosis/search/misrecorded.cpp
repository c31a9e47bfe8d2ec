#include "core/diagnosis/search/misrecorded.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/quantity.hpp"
#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

namespace {

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

std::optional<Case> with_columns_in_step(const Case& as_read, const Case& judged, const Diagnosis& d) {
  if (!judged.is_time_series || d.is_partial) return std::nullopt;
  std::optional<Case> moved;
  // A retuned model's numbers may have been bent to cover what comes early.
  const auto retuned = simulate(judged, d.retuned.model), best = simulate(judged, d.best.model),
             believed = simulate(judged, judged.model);
  for (std::size_t o = 0; o < judged.outputs.size(); ++o) {
    constexpr std::size_t most = 20;
    const auto when_later = [&](std::size_t rows) {
      return std::min(squares_when_later(judged, retuned, o, rows, most),
                      squares_when_later(judged, believed, o, rows, most));
    };
    std::size_t rows = 0;
    double least = thresholds::moved_column_leaves *
                   std::min(when_later(0), squares_when_later(judged, best, o, 0, most));
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
                            si(static_cast<double>(rows) * step, "s", 2) +
                            ") too early beside the others and was moved: look at how the columns were put "
                            "together");
  }
  return moved;
}

bool comes_late_again(const Case& moved, const Diagnosis& d) {
  return std::any_of(d.findings.begin(), d.findings.end(), [&](const Finding& finding) {
    if (moved.model.plant != physics::Plant::equations) return comes_late(finding.term);
    return finding.term.info->lateness != physics::Lateness::none &&
           std::any_of(moved.moved.begin(), moved.moved.end(), [&](std::size_t o) {
             return finding.term.on == physics::place_of_output(moved.model.equations, moved.outputs[o]);
           });
  });
}

}  // namespace invar::diagnosis
