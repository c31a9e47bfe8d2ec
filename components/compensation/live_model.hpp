// LiveModel: a compensation.yaml, or a diagnosed error map, checked against the machine and compiled for the loop.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/geometric/error_motion_tables.hpp"
#include "core/metrology/geometric/machine.hpp"
#include "core/metrology/geometric/volumetric_table.hpp"
#include "core/metrology/thermal/thermal_error.hpp"

namespace invar::compensation {

/// Limits of a model that may move the machine.
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
/// use it; empty: it is sound, and one of `geometric`, `components` and `thermal` is there.
struct LiveModel {
  /// Source of a state: a temperature that the loop knows, or its rate.
  enum class Source { temperature, heating_rate, zone };
  struct State {
    Source source = Source::temperature;
    std::size_t zone = 0;  // the loop's, for Source::zone
    Range range;           // it was calibrated over
  };

  std::string refusal;
  std::uint64_t id = 0;
  std::uint32_t checksum = 0;
  std::string text;  // the file, byte for byte

  std::optional<metrology::VolumetricTable> geometric;
  metrology::GeometricModel expanding;  // what `geometric` was compiled from, for its growth and its reversal
  bool expands = false;

  std::optional<metrology::ErrorMotionTables> components;  // in the place of `geometric`
  std::vector<State> states;                               // of `components`, in its order

  /// True for a model of the whole machine, not of an axis.
  [[nodiscard]] bool is_volumetric() const noexcept { return geometric || components; }
  /// [m], of a volumetric model, without its expansion. Real-time, as the others.
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position) const noexcept {
    return components ? components->error(position) : geometric->error(position);
  }
  /// Error by the direction of each axis' last motion: `moving` +1, -1, or 0 for the mean.
  [[nodiscard]] Eigen::Vector3d reversal(const Eigen::Vector3d& position,
                                         const Eigen::Vector3d& moving) const noexcept {
    return components ? components->model().reversal_at(position, moving)
                      : expanding.reversal_at(position, moving);
  }
  [[nodiscard]] Eigen::Vector3d sigma(const Eigen::Vector3d& position) const noexcept {
    return components ? components->sigma(position) : geometric->sigma(position);
  }

  std::optional<metrology::CompiledThermalError> thermal;
  std::size_t axis = 0;                                    // of `thermal`
  bool by_temperature = true;                              // false: good at any temperature
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
