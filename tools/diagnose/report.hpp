// What the diagnosis says: report.json, report.html, patched.yaml and the summary on the terminal.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/config/yaml.hpp"
#include "tools/diagnose/search.hpp"

namespace invar::diagnose {

/// report.json, version 1, as text.
std::string report_json(const Case& data, const Diagnosis& diagnosis);

/// The self-contained page.
std::string page_text(const Case& data, const Diagnosis& diagnosis, const std::string& subject);

/// A few lines for the terminal.
std::string summary(const Case& data, const Diagnosis& diagnosis);

/// "axis.force"; of a term in equations "equations.x1".
std::string site_of(const Case& data, const physics::Term& term);
/// The signals on which a term, or a finding, depends.
std::vector<std::string> dependence(const Case& data, const physics::Term& term);
std::vector<std::string> dependence(const Case& data, const Finding& finding);
/// The output and the column by which a variable of own equations is recorded, where they have names of their own.
std::vector<std::string> recorded_as(const Case& data, const std::string& variable);
/// "stribeck friction", or for what has no name "an effect without a name".
std::string title_of(const Finding& finding);
/// "coulomb friction"
std::string readable(std::string_view name);
/// Where a term acts, for somebody who does not know the library: "temperature sensor of pad".
std::string place_of(const Case& data, const physics::Term& term);
/// "amplitude 2.40 +- 0.01 N, pitch ..."
std::string sizes_of(const Case& data, const Diagnosis& diagnosis, const Finding& finding);
/// How many rows there were, and what of them was left out or put right.
std::string rows_read(const DataCount& count);
/// Which part of a recording the fits did not run through, and why; empty where they saw all of it.
std::string what_was_looked_at(const Case& data);
/// What to do next, in a sentence.
std::string next_experiment(const Case& data, const Diagnosis& diagnosis);
/// The verdict in one sentence.
std::string verdict_sentence(const Case& data, const Diagnosis& diagnosis);
/// "Stopped", or which budget ended.
std::string why_ended(const Diagnosis& diagnosis);
/// "not tried: this; that" of a search that ended before its end; empty of a whole one.
std::string not_tried(const Diagnosis& diagnosis);
/// What the verdict alone would hide, in a line: parameters that went far from what was believed, much that remains, and
/// what in the files does not go together; empty where there is none.
std::string beside_the_verdict(const Case& data, const Diagnosis& diagnosis);

/// One line for a recording on which a model that is handed over errs more than a simpler one; empty where none does.
std::string worse_on(const Diagnosis& diagnosis, const OtherRun& run);
/// Which curves were left out of the comparison with another recording, and why; empty where none was.
std::string left_out_of(const Case& data, const Diagnosis& diagnosis, const OtherRun& run);
/// An RMS in its unit; a run that diverged is said in words.
std::string error_of(double value, const FitRow& row);
/// What is said of a finding: its term's description, or what fits best in the place of a name.
std::string description_of(const Diagnosis& diagnosis, const Finding& finding);

/// A number of the user's that a fit took away from what he believed.
struct MovedNumber {
  std::string name, unit;
  double value = 0.0, believed = 0.0;  // SI, or as the user's own equations count
  double sigmas = 0.0;                 // of what was believed
};
/// So many sigmas: the model has become another.
inline constexpr double far_moved = 10.0;
/// Those that moved by more than `least` sigmas.
std::vector<MovedNumber> moved_numbers(const Diagnosis& diagnosis, double least);
/// The motion or recording that would tell two terms apart.
std::string separating_experiment(const Case& data, const physics::Term& one, const physics::Term& other);
/// A term's name, with its place where `other` is of the same name elsewhere.
std::string name_beside(const Case& data, const physics::Term& term, const physics::Term& other);
/// The unit of a term's parameter, by the place it acts on where the library leaves it open.
std::string unit_of(const Case& data, const physics::Term& term, std::size_t parameter);
/// The units, SI, of what an effect without a name adds at its place, and of what it goes with; empty where not known.
std::string unit_of_curve(const Case& data, const physics::Term& term);
/// Is a curve multiplied by a signal? The other node of an exchange of heat is a place.
bool is_multiplied(const physics::Term& term);
/// "a curve over position, up to 3 N", "hysteresis over position, elements that slip at 10 um to 2 mm".
std::string size_of_curve(const Case& data, const physics::Term& term);
std::string unit_of_variable(const Case& data, const std::string& variable);

}  // namespace invar::diagnose
