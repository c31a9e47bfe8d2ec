// ErrorMotionNetworks: the volumetric error from networks, one an error motion: functions of position, of position and
// temperature, or of more inputs.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/axis_reversal.hpp"
#include "core/metrology/geometric/volumetric.hpp"
#include "core/numerics/rbf_network.hpp"

namespace invar::metrology {

/// Beside the position an error motion may depend on so many states: the loop's tables have three inputs.
inline constexpr std::size_t most_states_of_an_error_motion = 2;

/// States on which an error motion may depend beside the position of its axis: `temperature` and `temperature_<zone>` [degC],
/// `heating_rate` [K/s], and the range of the calibration.
struct MachineState {
  std::string name;
  Range range;

  /// Where the error is asked for when the state is not known: the middle of the calibration.
  [[nodiscard]] double usual() const noexcept { return 0.5 * (range.lower + range.upper); }
};

/// One error motion as a Gaussian network: its first input is the position of its axis [m], the others are those of the
/// machine's states that it depends on.
struct ErrorMotionNetwork {
  numerics::RbfNetwork network;
  std::vector<std::size_t> states;  // indices into the machine's, at most `most_states_of_an_error_motion`
  double sigma = 0.0;               // standard deviation of the value inside the ranges, m or rad
  double slope = 0.0;               // how fast the value may leave its end outside, m or rad per input scale

  /// `of_machine`: all states of the machine.
  [[nodiscard]] double value(double position, std::span<const double> of_machine) const;
  /// Grows outside the ranges. Real-time.
  [[nodiscard]] double sigma_at(double position, std::span<const double> of_machine) const noexcept;
};

/// The thesis's form of the volumetric error (its chapter 2 over position, 3 over temperature, 6 over more). It is for
/// error motions that were measured one by one, with an angular interferometer, a level or a straightedge, at several
/// states of the machine. From displacement lines take `identify`. Offline; `ErrorMotionTables` is for the loop.
struct ErrorMotionNetworks {
  Chain chain;
  std::array<Range, 3> travel{Range{0, 1}, Range{0, 1}, Range{0, 1}};  // m
  Eigen::Vector3d tool = Eigen::Vector3d::Zero();                      // m
  Squareness squareness{};
  Squareness squareness_sigma{};
  std::vector<MachineState> states;
  std::array<std::optional<ErrorMotionNetwork>, error_motion_count> components;  // none: zero
  std::array<ReversalCurve, 3> reversal;  // of positioning, half to either side; empty where one way was read

  [[nodiscard]] ErrorMotions motions(const Eigen::Vector3d& position, std::span<const double> state) const;
  /// Actual minus commanded position [m] of a tool at a state of the machine, to first order with exact axis directions.
  /// Positions and states outside their ranges are held at the end.
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position, const Eigen::Vector3d& tool_offset,
                                      std::span<const double> state) const;
  /// Standard deviation [m] of `error`, the error motions' taken as independent.
  /// Real-time.
  [[nodiscard]] Eigen::Vector3d sigma_at(const Eigen::Vector3d& position, const Eigen::Vector3d& tool_offset,
                                         std::span<const double> state) const noexcept;
  /// Part of `error` that follows the sense of the last motion [m], and its standard deviation: as in `GeometricModel`. Real-time.
  [[nodiscard]] Eigen::Vector3d reversal_at(const Eigen::Vector3d& position,
                                            const Eigen::Vector3d& moving) const noexcept {
    return metrology::reversal_at(reversal, position, moving);
  }
  [[nodiscard]] Eigen::Vector3d reversal_sigma_at(const Eigen::Vector3d& position,
                                                  const Eigen::Vector3d& moving) const noexcept {
    return metrology::reversal_sigma_at(reversal, position, moving);
  }
  /// Whether every state lies within the calibration. Real-time.
  [[nodiscard]] bool knows(std::span<const double> state) const noexcept;
};

}  // namespace invar::metrology
