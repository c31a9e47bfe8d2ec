// The thermal error as a file.
#pragma once

#include <optional>

#include "core/compensation/model_file.hpp"
#include "core/metrology/thermal/thermal_error.hpp"

namespace invar::compensation {

/// Where in a machine a thermal error was measured; what a loop asks before it adds it to other corrections.
struct ThermalPlace {
  std::optional<int> axis;  // 0, 1, 2 for x, y, z; nothing: the file does not say
  /// Checksum of the geometric model that was active while it was measured: it describes what that one leaves. 0: none
  /// was, and it describes the whole error of its axis.
  std::uint32_t above = 0;
};
void write_place(ModelText& text, const ThermalPlace& place);
ThermalPlace read_place(const config::Node& root);

void write_thermal(ModelText& text, const metrology::ThermalError& model);

/// Reads what `write_thermal` wrote. Faults go to the document's list; the caller ends with `finish`.
metrology::ThermalError read_thermal(const config::Node& root);

}  // namespace invar::compensation
