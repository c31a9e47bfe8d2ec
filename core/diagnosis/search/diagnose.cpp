#include "core/diagnosis/search/diagnose.hpp"

#include <algorithm>
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

/// How much of what is missing a verdict names.
enum class Named { nothing, a_part, all };
Named named(const Diagnosis& d) {
  return d.verdict == Verdict::explained                                             ? Named::all
         : d.verdict == Verdict::partly_explained || d.verdict == Verdict::ambiguous ? Named::a_part
                                                                                     : Named::nothing;
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

/// Another way to take the same recordings. A search on it takes the place of the one before where it is preferred.
struct Alternate {
  const char* name;  // where it is not tried
  /// The recordings taken so; nothing where there is no reason to.
  std::optional<Case> (*take)(const Case& as_read, const Case& data, const Diagnosis& d);
  bool (*is_preferred)(const Case& other, const Diagnosis& found, const Case& data, const Diagnosis& d);
};

std::optional<Case> with_longer_windows(const Case& as_read, const Case& data, const Diagnosis& d) {
  if ((named(d) == Named::all && d.findings.size() < 2) || !has_longer_windows(data)) return std::nullopt;
  auto longer = as_read;
  longer.windows.are_long = true;
  return longer;
}

constexpr std::array alternates{
    Alternate{in_step_columns, with_columns_in_step,
              [](const Case& moved, const Diagnosis& found, const Case&, const Diagnosis&) {
                return !comes_late_again(moved, found);
              }},
    Alternate{longer_windows, with_longer_windows,
              // The same with fewer names is what more evidence makes of it.
              [](const Case&, const Diagnosis& found, const Case&, const Diagnosis& d) {
                return named(found) > named(d) ||
                       (named(found) == Named::all && found.findings.size() < d.findings.size());
              }},
    Alternate{quiet_inputs, with_quiet_inputs,
              [](const Case& quiet, const Diagnosis& found, const Case& data, const Diagnosis& d) {
                return !is_nearer(data, d, quiet, found);
              }}};

}  // namespace

Diagnosis diagnose(Case& data, const Progress& progress, const Options& options) {
  double reached = 0.0;  // a search begun anew does not go back on the bar
  const Progress onwards = [&](double share, const std::string& what) {
    progress(reached = std::max(reached, share), what);
  };
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
    take(recorded_hold, [&] { return settle_hold(data), true; });
    take(beside_the_law, [&] { return settle_recorded_current(data), true; });
  }
  Case as_read = data;
  auto best = Search{data, onwards, options}.run();
  const bool goes_on = options.refuses && !best.is_partial;
  if (options.refuses && !goes_on) add_once(not_tried, other_ways);
  for (const auto& alternate : alternates) {
    if (!goes_on) break;
    auto other = take(alternate.name, [&] { return alternate.take(as_read, data, best); });
    if (!other) continue;
    other->remembered = std::make_shared<Remembered>();
    const Case other_as_read = *other;
    auto found = Search{*other, onwards, options}.run();
    if (found.is_partial) {
      add_once(not_tried, alternate.name);
    } else if (alternate.is_preferred(*other, found, data, best)) {
      as_read = other_as_read;
      data = std::move(*other);
      best = std::move(found);
    }
  }
  if (goes_on) take(holds_longer, [&] { return hold_to_longer_windows(as_read, data, best), true; });
  say_not_tried(best, not_tried);
  progress(1.0, "done");
  return best;
}

}  // namespace invar::diagnosis
