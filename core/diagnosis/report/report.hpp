// Report: a diagnosis as report.json, as the summary on the terminal, and in the words that these share with the page.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/config/yaml.hpp"
#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// report.json, version 1, as text.
std::string report_json(const Case& data, const Diagnosis& diagnosis);

/// A few lines for the terminal.
std::string summary(const Case& data, const Diagnosis& diagnosis);

std::vector<std::string> dependence(const Case& data, const Finding& finding);
/// "stribeck friction", or for what has no name "an effect without a name".
std::string title_of(const Finding& finding);
/// "amplitude 2.40 +- 0.01 N, pitch ..."
std::string sizes_of(const Case& data, const Diagnosis& diagnosis, const Finding& finding);
/// How many rows there were, and what of them was left out or put right.
std::string rows_read(const DataCount& count);
/// Which part of a recording the fits did not run through, and why; empty where they saw all of it.
std::string what_was_looked_at(const Case& data);
/// The next step for the user, in a sentence.
std::string next_experiment(const Case& data, const Diagnosis& diagnosis);
/// The verdict in one sentence.
std::string verdict_sentence(const Case& data, const Diagnosis& diagnosis);
/// "Stopped", or which budget ended.
std::string why_ended(const Diagnosis& diagnosis);
/// "not tried: this; that" of a search that ended before its end; empty of a whole one.
std::string not_tried(const Diagnosis& diagnosis);
/// A line with all that the verdict alone would hide; empty where there is none. It names parameters that went far from what
/// was believed, a large residual, and contradictions in the files.
std::string beside_the_verdict(const Case& data, const Diagnosis& diagnosis);

/// One line for a recording on which a model that is handed over errs more than a simpler one; empty where none does.
std::string worse_on(const Diagnosis& diagnosis, const OtherRun& run);
/// Which curves were left out of the comparison with another recording, and why; empty where none was.
std::string left_out_of(const Case& data, const Diagnosis& diagnosis, const OtherRun& run);
/// An RMS in its unit; a run that diverged is said in words.
std::string error_of(double value, const FitRow& row);
/// The description of a finding: that of its term, or of the term that fits best in the place of a name.
std::string description_of(const Diagnosis& diagnosis, const Finding& finding);

/// A number of the user's that a fit took away from what he believed.
struct MovedNumber {
  std::string name, unit;
  double value = 0.0, believed = 0.0;  // SI, or as the user's own equations count
  double sigmas = 0.0;                 // of what was believed
};
/// Those that moved by more than `least` sigmas.
std::vector<MovedNumber> moved_numbers(const Diagnosis& diagnosis, double least);
/// The motion or recording that would tell two terms apart.
std::string separating_experiment(const Case& data, const physics::Term& one, const physics::Term& other);
/// "a curve over position, up to 3 N", "hysteresis over position, elements that slip at 10 um to 2 mm".
std::string size_of_curve(const Case& data, const physics::Term& term);
}  // namespace invar::diagnosis
