// Laws that stand for one another: what a fit begins from when one power of a variable takes the place of another.
#pragma once

#include "tools/diagnose/candidates.hpp"

namespace invar::diagnose {

/// The model with found term `term` put as another power of the same variable, with the strength that gives as much at the
/// sizes that the variable takes. A machine that swings for long answers in phase: from strength zero no such fit arrives.
/// Empty for anything but a power in the user's own equations, and without the names in `without`.
std::vector<physics::Model> other_powers(const Case& data, const physics::Model& model, std::size_t term,
                                         const std::set<std::string, std::less<>>& without);

/// The best of `start` and its other powers, each followed to its end under `weighing`.
Fit best_power(const Case& data, const Weighing& weighing, Fit start, std::size_t term,
               const std::set<std::string, std::less<>>& without);

}  // namespace invar::diagnose
