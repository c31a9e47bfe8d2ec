// One number of an input far beyond all others: a slip of the record, which the machine did not feel.
#pragma once

#include "core/physics/model.hpp"
#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Takes out (NaN, to be bridged) numbers of inputs that lie beyond the range of all others by several times its width.
/// Three of a signal at most; returns how many. In a map and for drops the whole row goes: nothing beside it says what
/// belongs there. Elsewhere only numbers that make the model's run fit worse go: a blow of one row is felt, a slip is not.
/// `record` holds inputs and outputs, in order.
std::size_t drop_lone_inputs(const physics::Model& model, physics::Record& record);

}  // namespace invar::diagnosis
