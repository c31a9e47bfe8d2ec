// Candidates for a model in the user's own equations: which terms, on which state, input or output, from which sizes.
#pragma once

#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Those of a model in the user's own equations.
std::vector<Start> equation_starts(const Case& data, const physics::Model& fitted);
/// `times_a_variable`: of what a rate has in proportion to another variable, as a number of the user's that changes, or two
/// states that act together.
enum class Curves { alone, times_a_variable };

/// Curves of each rate over each state, input and the time.
std::vector<Start> equation_curves(const Case& data, const physics::Model& fitted,
                                   Curves curves = Curves::alone);
std::vector<Start> equation_memories(const Case& data, const physics::Model& fitted);
/// Two terms that bend the same rate over the same variable: one law has room for one of them.
bool same_law(const physics::Term& one, const physics::Term& other);

}  // namespace invar::diagnosis
