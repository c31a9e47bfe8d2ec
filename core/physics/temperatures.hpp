// The temperatures of an error map: one beside the scale, and further ones of parts that warm by themselves.
#pragma once

#include <string_view>

#include "core/physics/model.hpp"

namespace invar::physics {

/// The temperature with which a term of an error map goes: `temperature`, or the further one of its place.
std::string_view temperature_of(const Term& term);
/// `temperature`, or a further one of an error map: `temperature_spindle`.
bool is_temperature(std::string_view signal);

}  // namespace invar::physics
