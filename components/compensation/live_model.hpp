// LiveModel: a compensation.yaml, or a diagnosed error map, checked against the machine and compiled for the loop.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/machine.hpp"
#include "core/metrology/thermal_error.hpp"
#include "core/metrology/volumetric_table.hpp"

namespace invar::compensation {

/// What a model must keep to, to be allowed to move the machine.
struct ModelLimits {
  int axes = 2;
  std::optional<metrology::Machine>
      machine;                     // chain and travels; nothing: only the number of axes is checked
  double bound = 2e-3;             // m, the largest correction
  double steepest = 1e-2;          // m/m, how fast a correction may change along the way
  double largest_sigma = 1e-4;     // m, at mid travel
  std::vector<std::string> zones;  // further temperatures that the loop knows, by name
};

/// Kept until the component is cleaned up, so that the loop may hold a plain pointer. `refusal` says why the loop must not
/// use it; empty: it is sound, and either `geometric` or `thermal` is there.
struct LiveModel {
  std::string refusal;
  std::uint64_t id = 0;
  std::uint32_t checksum = 0;
  std::string text;  // the file, byte for byte

  std::optional<metrology::VolumetricTable> geometric;
  metrology::GeometricModel expanding;  // what `geometric` was compiled from, for its growth by temperature
  bool expands = false;

  std::optional<metrology::CompiledThermalError> thermal;
  std::size_t axis = 0;                                    // of `thermal`
  bool by_temperature = true;                              // false: a model of one temperature, good at any
  std::uint32_t above = 0;                                 // the geometric model that it was measured above
  Range temperature;                                       // [degC] it was calibrated over
  std::vector<Range> zone_ranges;                          // [degC]
  std::array<std::size_t, metrology::most_zones> zones{};  // which of the loop's zones each of its own is
  double slope_temperature = 0.0;                          // [m/K]
  double lag = 0.0;                                        // [s]
  double lagged = 0.0;                                     // [degC], the loop's
};

/// Fills the model; throws for a file that cannot be read. Not real-time.
void load_live_model(const std::filesystem::path& file, const ModelLimits& limits, LiveModel& live);

}  // namespace invar::compensation
