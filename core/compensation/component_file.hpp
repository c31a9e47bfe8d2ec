// Error motions as networks, as a file.
#pragma once

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric/error_motion_networks.hpp"

namespace invar::compensation {

void write_components(ModelText& text, const metrology::ErrorMotionNetworks& model);

/// Reads what `write_components` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::ErrorMotionNetworks read_components(const config::Node& root);

}  // namespace invar::compensation
