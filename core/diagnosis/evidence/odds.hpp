// Probability that a name is the right one, against the other names that were tried and a cause that none of these is. It also
// stands against the name's relatives, which look the same where a recording does not set them apart.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// Odds of "some other cause" against a claimed name.
/// `gain`: log evidence by which the name wins, in independent rows; the odds fall with it, as a small effect looks like many.
/// `left`: share of the mismatch that the name leaves and that still follows the recording; the odds rise with it.
/// `shape`: share that a freer shape of the name explains better beyond chance; a fraction of a percent is a matter of form.
/// `share`: share of the mismatch that goes with a name beside others, 1 for the only one. The odds rise as it comes near what
/// the others' idealised form may leave. Fitted to claims on synthetic machines, the right names in the library and out of it
/// (tests/bench/mismatch_reliability.py).
double odds_of_another_cause(double gain, double left, double shape, double share);

/// Odds that the effect is none: the likelihood of zero over that of the value, for the best known of its amplitudes. Sigmas
/// come from the spread between blocks; evidence that one stretch alone brings does not make an effect.
double odds_of_nothing(const Finding& finding);

/// Odds that a relative of term `place` of the best model is meant, in the library or not. Relatives are a lag and a delay,
/// friction that slides at once or springs first, a sine that enters at the motor or the carriage.
double odds_of_relatives(const Case& data, const Fit& best, std::size_t place, const Finding& finding);

/// Does an alternative say anything else than the finding? A term of equations that acts at the same place over a state that
/// runs alike is the same name for the same cause. Another input is another cause, however alike the two run.
bool is_another_cause(const Case& data, const Finding& finding, const Alternative& alternative);

/// By a lag or by a delay: an instrument's latency is the name of either.
bool comes_late(const physics::Term& term);

/// Are they one effect whose place alone is open? A delay before a model in one piece looks the same behind it. A steady rate or
/// a drag at one state acts at the next in a chain, and so does a limit or a dead zone on the way.
bool is_elsewhere(const physics::Term& one, const physics::Term& other);

/// The share that a name leaves of the mismatch beyond noise. `won` and `excess`, by output, in the power of the noise: what
/// the name explains and what is left. Returned is the worst output with at least a tenth of all that the name explains.
double rest_beside(const std::vector<double>& won, const std::vector<double>& excess);

/// Probability of a name in place of the finding's.
double probability_of(const Finding& finding, const Alternative& alternative);

/// Puts the odds together: `probability` and `other_cause` of a finding whose `gain`, `share` and alternatives are known, and
/// the `rest` beside it, a share.
void weigh_name(const Case& data, const Diagnosis& d, std::size_t place, double rest, Finding& finding);

}  // namespace invar::diagnosis
