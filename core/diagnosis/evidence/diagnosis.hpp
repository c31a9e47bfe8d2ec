// Diagnosis: what was found, what it stands on, and what was turned down.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/checks/control_law.hpp"
#include "core/diagnosis/estimate/fit_comparison.hpp"
#include "core/diagnosis/evidence/margins.hpp"

namespace invar::diagnosis {

struct Alternative {
  physics::Term term;
  double log_odds = 0.0;  // evidence against the finding's; negative: less likely

  /// Too near to be told from the finding.
  [[nodiscard]] bool explains_as_well() const { return log_odds > -3.0; }
};

struct Finding {
  physics::Term term;
  std::vector<double> sigmas;  // of the term's parameters
  double gain = 0.0;           // log likelihood that is lost without it
  double probability = 1.0;
  double share = 0.0;          // of the mismatch that goes with it
  double share_of_rest = 0.0;  // of what the user's own numbers, retuned, leave of it
  /// The name that is more than nine times as likely wrong as right: the finding goes without it, patched.yaml has it as the
  /// nearest that there is.
  const physics::TermInfo* stand_in = nullptr;
  double other_shape =
      0.0;  // of what a freer shape of the same name explains, the share that the name leaves
  double other_cause = 0.0;  // odds that it is none of the names that were tried
  double relatives = 0.0;    // odds of names that look the same on this recording, in the library or not
  std::vector<Alternative> alternatives;
};

struct Rejection {
  std::string term, why;
  double gain = 0.0;  // log evidence
};

/// Where an unknown cause sits, as far as the recording tells.
struct Suspect {
  std::string site, place;  // "axis.force"; in words
  std::vector<std::string> depends_on;
};

struct Quantity {
  std::string name, unit;
  double value = 0.0;
};

struct Detectable {
  std::string term, on, parameter, unit;
  double value = 0.0;
  std::optional<Quantity> at;  // of a wave: the pitch or frequency for which it is said
};

struct FitRow {
  std::string signal, unit;
  double before = 0.0, retuned = 0.0, after = 0.0, noise_floor = 0.0;
};

/// A recording that no fit has seen, and what each model makes of it.
struct OtherRun {
  std::string name;
  physics::Record inputs;
  bool fits_start = false;                    // each model starts where it comes nearest
  std::vector<std::vector<double>> measured;  // by output; NaN where nothing is to be compared
  physics::Outputs before, retuned, after;
  std::vector<FitRow> fit;   // of the outputs that were measured
  std::string how_windowed;  // judged over windows, and why; empty: in one free run
  std::vector<std::size_t>
      left_out;                   // found terms (places in the best model) that say nothing of this recording
  bool is_worse = false;          // retuned or with what was found the model errs more than as given
  bool is_worse_patched = false;  // with what was found it errs more than as given or retuned
  bool is_worse_with_them = false;  // patched.yaml would be, with the terms that are left out here
};

/// A term that the user named, fitted whatever the search made of it.
struct Assumed {
  Finding finding;  // term and sigmas alone
  std::vector<FitRow> heldout;
};

enum class Verdict { no_mismatch, parameters_only, explained, partly_explained, ambiguous, unknown_physics };

struct Diagnosis {
  Verdict verdict = Verdict::no_mismatch;
  Weighing weighing;
  Fit nominal, retuned, best;
  double mismatch_gain = 0.0;        // log evidence of the best model over the nominal one
  double parameter_excursion = 0.0;  // sigmas
  std::vector<Finding> findings;
  std::vector<Rejection> rejected;
  std::vector<Detectable> detectable;
  std::vector<FitRow> heldout, train;
  std::vector<OtherRun> other_runs;
  std::vector<Assumed> assumed;
  double unexplained = 1.0;  // residual over noise of the best model
  std::vector<std::string> unexplained_over;
  std::optional<Suspect> suspect;      // of unknown physics that has no curve either
  double still_follows = 0.0;          // share of the mismatch that is left and follows what was recorded
  std::optional<LawOff> off_law;       // of an axis in closed loop
  bool is_unnamed = false;             // the finding is a curve alone
  bool is_partial = false;             // stopped before all was tried
  std::vector<std::string> not_tried;  // of what is partial: the steps of the search that were cut off
  double budget = 0.0;                 // [s] that ended it; 0: it was not the time
  bool has_rest = false;               // the last finding is a curve beside named ones

  /// Remembers the best showing of a term that is not claimed.
  void reject(const std::string& term, const std::string& why, double gain);
};

std::string name_of(Verdict verdict);

/// The most that any output leaves in units of its noise: on held-out stretches, or on those that were fitted to.
double most_over_noise(const Diagnosis& d);

}  // namespace invar::diagnosis
