// Angles that people write, in radians.
#pragma once

#include <numbers>

namespace invar {

inline constexpr double degree = std::numbers::pi / 180.0;
inline constexpr double arcsec = degree / 3600.0;

}  // namespace invar
