// How likely a name is the right one, against the other names that were tried and against a cause that none of them is.
#pragma once

#include <algorithm>
#include <cmath>

namespace invar::diagnose {

/// With more than these a name is not stated: it is right in three cases of ten at most.
inline constexpr double unlikely_odds = 7.0 / 3.0;

/// Odds of "some other cause" against a claimed name: they fall with the log evidence by which the name wins (a small
/// effect looks like many things; the evidence is counted in independent rows), rise with the share of the mismatch that
/// the name leaves and that still follows the recording, and with what a freer shape of the name explains better beyond
/// chance (`shape`, a share; 0: nothing; a fraction of a percent is a matter of form). The first three were fitted to claims on made machines, the right names in the
/// library and out of it (tests/bench/mismatch_reliability.py; figures in README.md there).
inline double odds_of_another_cause(double gain, double left, double shape) {
  constexpr double at_100 = 0.18, slope = 0.52, by_left = 28.0, by_shape = 0.5, form = 0.005;
  return at_100 * std::pow(std::max(gain, 1.0) / 100.0, -slope) + by_left * (left + shape) +
         by_shape * std::min(1.0, shape / form);
}

}  // namespace invar::diagnose
