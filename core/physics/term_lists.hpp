// The lists of which the library is the sum.
#pragma once

#include <vector>

#include "core/physics/term.hpp"

namespace invar::physics {

/// Terms of error maps, droplets, sensors and equations; empty for the plants that step in real time.
std::vector<const TermInfo*> static_terms_of(Plant plant);

}  // namespace invar::physics
