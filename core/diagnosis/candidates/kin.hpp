// Laws that stand for one another: what a fit begins from when one power of a variable takes the place of another.
#pragma once

#include "core/diagnosis/candidates/candidates.hpp"

namespace invar::diagnosis {

/// The model with found term `term` put as another law of the same variable. For a power: another power, with the strength that
/// gives as much at the sizes that the variable takes. For a delay or a lag: the other of the two with the same
/// time, there and of each input. A machine that swings for long answers in phase: from strength zero no such fit arrives.
/// For friction of an axis that sticks or bends: Coulomb's. Empty for anything else; without the names in `without`.
std::vector<physics::Model> other_laws(const Case& data, const physics::Model& model, std::size_t term,
                                       const std::set<std::string, std::less<>>& without);

/// Fits that begin from the other laws of `start`, the two that come nearest followed to their end under `weighing`.
std::vector<Fit> fits_of_other_laws(const Case& data, const Weighing& weighing, const Fit& start,
                                    std::size_t term, const std::set<std::string, std::less<>>& without);

}  // namespace invar::diagnosis
