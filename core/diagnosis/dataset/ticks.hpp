// Do the rows of a controller's recording follow one another as its ticks do?
#pragma once

#include <filesystem>
#include <vector>

#include "core/physics/model.hpp"

namespace invar::diagnosis {

/// Throws InputError where the rows of a controller's recording are plainly no ticks of it: 200 of its periods apart, or ten
/// to a period. `time` in order, in s.
void check_ticks(const physics::Model& model, const std::vector<double>& time,
                 const std::filesystem::path& file);

}  // namespace invar::diagnosis
