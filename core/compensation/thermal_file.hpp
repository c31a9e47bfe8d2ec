// The thermal error as a file.
#pragma once

#include "core/compensation/model_file.hpp"
#include "core/metrology/thermal_error.hpp"

namespace invar::compensation {

void write_thermal(ModelText& text, const metrology::ThermalError& model);

/// Reads what `write_thermal` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::ThermalError read_thermal(const config::Node& root);

}  // namespace invar::compensation
