// Names that are not sure. A name is said as long as the odds of another cause (odds.hpp) leave it three chances in ten.
// Below that, free courses take its place where they do better, and it stays as the nearest that has a name. Where none does
// better it stays, said with its probability, down to one chance in ten; below, the fit stays without its name. Where the
// noise is known and the name plainly leaves more, that bar is three chances in ten.
#pragma once

#include <optional>

#include "core/diagnosis/evidence/other_cause.hpp"

namespace invar::diagnosis {

/// Takes back names in whose place a free course over another variable leads by `claim_margin`: that alone leaves them no
/// chance. For the others it notes how much a freer shape explains. `beside`: the courses beside the best model, where known.
void doubt(const Case& data, Diagnosis& d, std::optional<Beside>& beside);

/// After `conclude`: puts courses in the place of names with odds against them above `unlikely_odds`, where these do better.
/// False: nothing changed.
bool set_aside(const Case& data, Diagnosis& d);

/// Leaves the name of a finding away where another cause is nine times as likely. Seven to three is enough where
/// residuals far from the noise show that the name is not the whole truth (`rests`, a share by finding; `is_far`, by output).
/// The same holds where the names lead the numbers of a built-in plant far astray. Even odds are enough where the residuals are
/// ten times the noise.
void leave_unsaid(Diagnosis& d, const std::vector<double>& rests, bool is_far, double times_the_noise);

/// Where more than twice the noise is left, a place without a name is as sure as what its curve takes away on rows that no fit
/// saw. One that explains nothing may as well be the wrong place.
void doubt_places(Diagnosis& d);

/// Findings whose names were all left unsaid are held to what a curve without a name must do: an engineer sees the residual
/// shrink, on rows that no fit saw. Those that do not are taken back; true where they were.
bool leave_out_unseen(Diagnosis& d);

}  // namespace invar::diagnosis
