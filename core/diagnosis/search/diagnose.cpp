#include "core/diagnosis/search/diagnose.hpp"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/checks/added_to_command.hpp"
#include "core/diagnosis/search/longer_windows.hpp"
#include "core/diagnosis/search/misrecorded.hpp"
#include "core/diagnosis/search/quiet_inputs.hpp"
#include "core/diagnosis/search/reference_hold.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// How much a verdict says of what is missing.
int named_by(const Diagnosis& d) {
  return d.verdict == Verdict::explained                                             ? 2
         : d.verdict == Verdict::partly_explained || d.verdict == Verdict::ambiguous ? 1
                                                                                     : 0;
}

/// Does the one leave plainly less of an output than the other? What lags behind its inputs is like one whose inputs were
/// smoothed, but not as near.
bool is_nearer(const Case& data, const Diagnosis& d, const Case& other_data, const Diagnosis& other) {
  const auto left = squares_left(data, d.best.model),
             left_by_other = squares_left(other_data, other.best.model);
  for (std::size_t o = 0; o < left.size(); ++o)
    if (left[o] < thresholds::other_reading_leaves * left_by_other[o]) return true;
  return false;
}

/// Another way to read the same recordings. A search on it takes the place of the one before where it is better.
struct Reading {
  const char* name;
  /// Nothing where there is no reason to read them so.
  std::optional<Case> (*read)(const Case& as_read, const Case& data, const Diagnosis& d);
  bool (*is_better)(const Case& other, const Diagnosis& found, const Case& data, const Diagnosis& d);
};

std::optional<Case> in_longer_windows(const Case& as_read, const Case& data, const Diagnosis& d) {
  if ((named_by(d) == 2 && d.findings.size() < 2) || !has_longer_windows(data)) return std::nullopt;
  auto longer = as_read;
  longer.windows.few = true;
  return longer;
}

constexpr std::array readings{
    Reading{in_step_columns, with_columns_in_step,
            [](const Case& moved, const Diagnosis& found, const Case&, const Diagnosis&) {
              return !comes_late_again(moved, found);
            }},
    Reading{"longer windows", in_longer_windows,
            // The same with fewer names is what more evidence makes of it.
            [](const Case&, const Diagnosis& found, const Case&, const Diagnosis& d) {
              return named_by(found) > named_by(d) ||
                     (named_by(found) == 2 && found.findings.size() < d.findings.size());
            }},
    Reading{quiet_inputs, with_quiet_inputs,
            [](const Case& quiet, const Diagnosis& found, const Case& data, const Diagnosis& d) {
              return !is_nearer(data, d, quiet, found);
            }}};

}  // namespace

Diagnosis diagnose(Case& data, const Progress& progress, const Options& options) {
  std::vector<std::string> not_tried;
  // A step beside the search proper: one that is interrupted counts for nothing, and is named.
  const auto take = [&](const char* what, const auto& step) -> decltype(step()) {
    data.stop = options.stop;
    auto found = unless_stopped(options.stop, step);
    data.stop = {};
    if (found) return std::move(*found);
    add_once(not_tried, what);
    return {};
  };
  if (data.model.plant == physics::Plant::axis) {  // before any physics: what the recordings hold
    take("how the reference goes on between rows", [&] { return settle_hold(data), true; });
    take("the current beside the controller's law", [&] { return settle_recorded_current(data), true; });
  }
  Case as_read = data;
  auto best = Search{data, progress, options}.run();
  if (!options.refuses) return best;
  for (const auto& reading : readings) {
    if (best.is_partial) break;
    auto other = take(reading.name, [&] { return reading.read(as_read, data, best); });
    if (!other) continue;
    other->remembered = std::make_shared<Remembered>();
    const Case other_as_read = *other;
    auto found = Search{*other, progress, options}.run();
    if (found.is_partial) {
      add_once(not_tried, reading.name);
    } else if (reading.is_better(*other, found, data, best)) {
      as_read = other_as_read;
      data = std::move(*other);
      best = std::move(found);
    }
  }
  if (!best.is_partial)
    take("the best model in longer windows",
         [&] { return keep_to_longer_windows(as_read, data, best), true; });
  say_not_tried(best, not_tried);
  return best;
}

}  // namespace invar::diagnosis
