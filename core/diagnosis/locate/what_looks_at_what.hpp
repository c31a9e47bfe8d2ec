// Dependencies in the user's own equations, read from the formulas alone.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/physics/model.hpp"

namespace invar::diagnosis {

/// Does a formula hold this name?
bool mentions(const std::string& formula, std::string_view name);
/// A state whose rate is only another state (x' = v): nothing can be missing there.
bool is_kinematic(const physics::Equations& equations, const physics::Equations::State& state);
/// A state that is the rate of another (x' = v): friction acts against its sign.
bool is_speed(const physics::Equations& equations, const std::string& state);
/// Does no state move? Then outputs follow their inputs row by row.
bool is_static(const physics::Equations& equations);
/// Does the model look at this input? Else nothing at it can matter but what leads it elsewhere.
bool is_used(const physics::Equations& equations, const std::string& symbol);
/// The states of the machine. A filter or a sum that only the control law looks at is the controller's, which runs as it is
/// written: no physics is missing there.
std::vector<physics::Equations::State> states_of_machine(const physics::Equations& equations);

}  // namespace invar::diagnosis
