// The positioning error of a rotary axis as a file: compensation.yaml of kind rotary.
#pragma once

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric/rotary_axis.hpp"

namespace invar::compensation {

void write_rotary(ModelText& text, const metrology::RotaryAxis& axis);

/// Reads what `write_rotary` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::RotaryAxis read_rotary(const config::Node& root);

/// A whole file: seal, kind and content checked. Throws InputError.
metrology::RotaryAxis load_rotary(const std::filesystem::path& file);

}  // namespace invar::compensation
