// A diagnosed error map (model.yaml of plant error_map) as the error that compensation corrects on one axis.
#pragma once

#include <string>
#include <string_view>

#include "core/metrology/thermal/thermal_error.hpp"
#include "core/physics/model.hpp"

namespace invar::compensation {

/// Why compensation cannot correct for a term; empty: it can, or the term moves no carriage, as the laser's.
std::string_view why_not_corrected(const physics::Term& term);

/// Why the model says too little to correct by it at all; empty: it says enough.
std::string why_not_corrected(const physics::Model& model);

/// Baseline, expansion and terms over position and temperature; what has a `why_not_corrected`, and the laser's own errors,
/// are left out. Networks meet the model to 5 nm, or as near as 1000 centres come (a curve with kinks). Sigma from those in
/// the file, as if independent; a term's number without one may be wrong by itself. The baseline has none. Preconditions: plant
/// error_map, nothing against it above.
metrology::ThermalError thermal_error_of(const physics::Model& model);

}  // namespace invar::compensation
