// How likely a name is the right one: against the other names that were tried, against its relatives, which look the same where
// a recording does not show what sets them apart, and against a cause that none of these is.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// Odds of "some other cause" against a claimed name: they fall with the log evidence by which the name wins (a small
/// effect looks like many things; the evidence is counted in independent rows), rise with the share of the mismatch that
/// the name leaves and that still follows the recording, with what a freer shape of the name explains better beyond
/// chance (`shape`, a share; 0: nothing; a fraction of a percent is a matter of form), and, of a name beside others, as the
/// share of the mismatch that goes with it comes near what their own idealised form may leave (`share`; 1: it is the only
/// one). Fitted to claims on made machines, the right names in the library and out of it
/// (tests/bench/mismatch_reliability.py; figures in README.md there).
double odds_of_another_cause(double gain, double left, double shape, double share);

/// Odds that a relative of term `place` of the best model is meant, which may be in the library or not: what comes late by a
/// lag or a delay, friction that slides at once or springs first, a sine that enters at the motor or the carriage.
double odds_of_relatives(const Case& data, const Fit& best, std::size_t place, const Finding& finding);

/// Does an alternative say anything else than the finding? A term of equations that acts at the same place over a variable
/// that runs alike is the same name for the same cause.
bool is_another_cause(const Finding& finding, const Alternative& alternative);

/// By a lag or by a delay: an instrument's latency is the name of either.
bool comes_late(const physics::Term& term);

/// Are they one effect whose place alone is open? What comes late before a model in one piece comes late behind it as well,
/// a steady rate or a drag that acts at one state acts at the next in a chain, and so does a limit or a dead zone on the way.
bool is_elsewhere(const physics::Term& one, const physics::Term& other);

/// Of what the outputs that a name explains left beyond the noise without it (`won` and `excess`, by output, in the power of
/// the noise), the share that they still leave: of the worst of those with at least a tenth of all that it explains.
double rest_beside(const std::vector<double>& won, const std::vector<double>& excess);

/// Puts the odds together: `probability` and `other_cause` of a finding whose `gain`, `share` and alternatives are known, and
/// the `rest` beside it, a share.
void weigh_name(const Case& data, const Diagnosis& d, std::size_t place, double rest, Finding& finding);

}  // namespace invar::diagnosis
