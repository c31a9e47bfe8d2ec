// At a steady speed one way a ripple along the way and a disturbance in time look alike: each is weighed against the other.
#pragma once

#include <optional>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// A force on an axis that repeats in time, as one that repeats along the way, and the reverse. Its pitch, frequency and phase
/// look the same at the speed of the longest recording. Nothing where the carriage strays from that speed by more
/// than a pitch, and for all other terms.
std::optional<physics::Term> twin_at_steady_speed(const Case& data, const physics::Term& term);

}  // namespace invar::diagnosis
