// One number of an input far beyond all others: a slip of the record, which the machine did not feel.
#pragma once

#include "core/physics/model.hpp"
#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Takes out (NaN, to be bridged) numbers of inputs that lie beyond the range of all others by several times its width, three
/// of a signal at most, and returns how many. Of points of a map and drops the whole row goes: nothing beside it says what
/// belongs there. Elsewhere only what makes the model's run fit the readings worse: a blow of one row is felt, a slip is not.
/// `record` holds inputs and outputs, in order.
std::size_t drop_lone_inputs(const physics::Model& model, physics::Record& record);

}  // namespace invar::diagnosis
