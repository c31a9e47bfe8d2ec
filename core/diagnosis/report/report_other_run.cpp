// What is said of a recording that no fit saw, and of numbers that no machine reaches.
#include <cmath>

#include "core/base/quantity.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

std::string error_of(double value, const FitRow& row) {
  // A machine's error is known to one in a million at best; beyond, it is the model that left.
  const bool is_far = row.noise_floor > 0.0 && value > thresholds::runs_away * row.noise_floor &&
                      value > thresholds::runs_away;
  return !std::isfinite(value) || is_far || value > thresholds::nowhere ? "runs away" : si(value, row.unit);
}

std::string worse_on(const Diagnosis& d, const OtherRun& run) {
  if (!run.is_worse) return "";
  std::string text;
  const bool found = !d.findings.empty();
  for (const auto& row : run.fit)
    text += (text.empty() ? "" : "; ") + row.signal + " " + error_of(row.before, row) + " as it is, " +
            error_of(row.retuned, row) + " retuned" +
            (found ? ", " + error_of(row.after, row) + " with what was found" : std::string{});
  return "Worse on " + run.name +
         (run.is_worse_patched ? ", do not take it over: "
                               : " where it is only retuned, do not take over retuned.yaml: ") +
         text + ".";
}

std::string left_out_of(const Case& data, const Diagnosis& d, const OtherRun& run) {
  std::string text;
  for (const auto t : run.left_out) {
    const auto& term = d.best.model.terms[t];
    const bool is_course = is_over_time(term);
    text += (text.empty() ? "" : "; ") + std::string{"left out in "} + run.name + ": the curve over " +
            term.curve.over + " (" + place_of(data, term) + "), " +
            (is_course ? "which is of the recording that it was fitted to alone"
                       : "for " + term.curve.over + " goes past it there");
  }
  return text;
}

}  // namespace invar::diagnosis
