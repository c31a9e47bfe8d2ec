// The geometric error as a file.
#pragma once

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric/geometric_model.hpp"

namespace invar::compensation {

void write_geometric(ModelText& text, const metrology::GeometricModel& model);

/// Reads what `write_geometric` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::GeometricModel read_geometric(const config::Node& root);

/// A whole file: seal, kind and content checked. Throws InputError. For the component `compensation` and tools.
metrology::GeometricModel load_geometric(const std::filesystem::path& file);

}  // namespace invar::compensation
