// Does the current come late behind what the controller's law asks for, by a delay or through a lag?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/checks/control_law.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// An effect between controller and drive.
struct Added {
  physics::Term term;  // a name of the library, or a curve added to the command where it has none
  std::string words;   // "a square wave of 2.5 A at 1 Hz"
  double share = 0.0;  // of the squares that the law leaves of the current beyond its noise
};

/// A term of an axis with the numbers from which a fit of it begins.
physics::Term started(const char* name);

/// The current is what the law asked for some time ago. Noise of the readings that the controller did not see makes a late
/// law look better whatever is true. Only the part that goes with the expected current counts (instrumental variables).
std::optional<Added> comes_late_from_law(const Case& data, const std::vector<LawRows>& law);

}  // namespace invar::diagnosis
