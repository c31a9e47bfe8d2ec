// A recording that no fit has seen: what the models before, retuned and after make of it in a free run.
#pragma once

#include <filesystem>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

struct OtherRunFiles {
  std::filesystem::path inputs;   // .csv, .csv.gz or the cell's .mcap
  std::filesystem::path outputs;  // where they lie in a file of their own: the same rows
  bool fits_start =
      false;  // the initial state in the first row is a guess: moved until each model is nearest
};

/// Reads it. Throws InputError for what is unusable.
OtherRun read_other_run(const physics::Model& model, const OtherRunFiles& files);
/// Runs the three models over it as `invar simulate` does, each over windows of its own states where the diagnosis did so, and
/// compares. Found curves over time, or asked past their knots, are left out.
void compare(const Case& data, const Diagnosis& diagnosis, OtherRun& run);
/// Compares, and keeps the run with the diagnosis: `explained` is no more than `partly_explained` where the model with what was
/// found errs by more than twice the noise there.
void check_on(const Case& data, Diagnosis& diagnosis, OtherRun run);
/// The best model without some of its found terms (places in it, in order), the rest fitted anew; without any it is the retuned
/// one.
physics::Model best_without(const Case& data, const Diagnosis& diagnosis,
                            const std::vector<std::size_t>& terms);
/// Places in the best model of the curves that were left out of a comparison and would make patched.yaml worse there.
std::vector<std::size_t> of_one_recording(const Diagnosis& diagnosis);

}  // namespace invar::diagnosis
