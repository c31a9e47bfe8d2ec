// What a model in the user's own equations may call its numbers, and what its expressions may hold.
#pragma once

#include "core/config/yaml.hpp"
#include "core/physics/model.hpp"

namespace invar::model {

/// Faults at the lines where a name is none, stands for two things or for a function, where an expression assigns or is
/// two, and where a loop has no input to close or follows itself.
void check_own_expressions(const config::Node& root, const physics::Model& model);

}  // namespace invar::model
