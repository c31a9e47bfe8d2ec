// In which units a model counts: a rotary machine in rad and N m where the tables of its plant say m and N, a heater in
// what commands it.
#pragma once

#include <string>
#include <string_view>

#include "core/physics/model.hpp"

namespace invar::physics {

/// An axis with a moment of inertia, a sensor of angles.
bool is_rotary(const Model& model);
/// The unit of a rotary machine in the place of a straight one's: "N s/m" -> "N m s/rad"; others stay as they are.
std::string rotary_unit(std::string_view unit);
/// Signals as a rotary machine has them.
void count_in_angles(Model& model);
/// `unit` of the plant's tables as this model counts it.
std::string counted_unit(const Model& model, std::string_view unit);
/// The unit of a parameter of a term in this model; "*" of what the user's own equations leave open.
std::string unit_of_parameter(const Model& model, const Term& term, std::size_t parameter);
/// From where to where it may go in this model.
Range bounds_of_parameter(const Model& model, const Term& term, std::size_t parameter);
/// Unit of the command of the first heater of a node: "W", "%", "V"; "W" where there is none.
std::string heater_unit(const Model& model, std::string_view node);

}  // namespace invar::physics
