// The droplet trajectory as a file.
#pragma once

#include "core/compensation/model_file.hpp"
#include "core/metrology/droplet/droplet_trajectory.hpp"

namespace invar::compensation {

void write_trajectory(ModelText& text, const metrology::DropletTrajectory& trajectory);

/// Reads what `write_trajectory` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::DropletTrajectory read_trajectory(const config::Node& root);

/// A whole file: seal, kind and content checked. Throws InputError. For the component `dispenser` and tools.
metrology::DropletTrajectory load_trajectory(const std::filesystem::path& file);

}  // namespace invar::compensation
