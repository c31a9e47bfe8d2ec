// Is what a further term explains only the wrong form of a term that was found before?
#pragma once

#include <optional>
#include <string>

#include "core/diagnosis/candidates/candidates.hpp"

namespace invar::diagnosis {

/// The same curve with fewer knots: a course that bends a little costs little.
Start coarser(Start start, std::size_t knots);

/// Over what a term in the user's equations goes; empty: over nothing.
std::string variable_of(const physics::Term& term);
/// A free course over time.
bool is_over_time(const physics::Term& term);

/// May this curve stand for another course of the term's own effect?
bool is_course_of(const physics::Term& curve, const physics::Term& term);

/// The best fit of `base` with one of its found terms free to take any course over its own variable, and the number of that
/// term. Nothing where `further`, which has one term more than `base`, has more evidence. Both under one weighing.
struct OtherForm {
  std::size_t term = 0;
  double evidence = 0.0;
};
std::optional<OtherForm> other_form(const Case& data, const Weighing& weighing, const Fit& base,
                                    const Fit& further);

/// Is what `further` adds to `base` so small a share of the mismatch, which `retuned` shows, that the form of the terms in
/// `base` may make it? Laws are idealised: no machine's friction is the same to a percent wherever it rubs.
bool is_trifle(const Case& data, const Fit& retuned, const Fit& base, const Fit& further);

}  // namespace invar::diagnosis
