// The readers of outside files, each with valid inputs to begin from.
#pragma once

#include <vector>

#include "tests/fuzz/driver.hpp"

namespace invar::fuzz {

std::vector<Target> text_targets();       // YAML of every kind, CSV, formulas, units
std::vector<Target> recording_targets();  // MCAP, IDL, CDR
std::vector<Target> image_targets();

}  // namespace invar::fuzz
