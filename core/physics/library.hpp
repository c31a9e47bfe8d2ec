// The library: every physics term that simulator, diagnosis and compensators share, in one explicit list.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/term.hpp"
#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

/// All terms of a plant, in the order of the list. Any thread.
std::vector<const TermInfo*> terms_of(Plant plant);
/// The term by its name; nullptr where the plant has none. `unmodelled` exists at every site: see
/// `unmodelled`.
const TermInfo* find_term(Plant plant, std::string_view name);
/// The term that stands for physics without a name, at a site: its shape is a Curve.
const TermInfo* unmodelled(Plant plant, std::string_view site);
/// The signals that a curve at this site may be multiplied by; of an actuator the `command`, to which it is then added.
std::vector<std::string_view> multipliers_of(const TermInfo& unmodelled);
/// The plant by the name that model.yaml writes; false where there is none.
bool plant_by_name(std::string_view name, Plant& plant);

/// Functions of the term in its plant; nullptr for a term of another plant.
const AxisTermKind* axis_kind(const TermInfo& info);
const ThermalTermKind* thermal_kind(const TermInfo& info);

}  // namespace invar::physics
