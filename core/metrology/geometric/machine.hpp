// Machine: what machine.yaml says of a machine, and the hidden errors of a simulated one.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "core/base/range.hpp"
#include "core/metrology/geometric/error_function.hpp"
#include "core/metrology/geometric/volumetric.hpp"

namespace invar::metrology {

/// The 21 errors of a simulated machine. Evaluation is real-time.
struct MachineErrors {
  std::array<ErrorFunction, error_motion_count> functions;
  Squareness squareness{};
  std::array<ErrorFunction, 3> reversal;  // m, lost motion of an axis: half of it to either side of the mean
  // Effect of heat along each axis; core/machine/heat_growth.hpp makes a displacement of it.
  std::array<double, 3> expansion{};       // 1/K, of the axis' scale, by the slide's temperature
  std::array<double, 3> bending{};         // m/K at mid travel, by the slide's temperature
  std::array<double, 3> base_expansion{};  // 1/K, by the base's temperature
  double scale_lag = 0.0;                  // s: the scale follows the slide's thermometer so late
  double reference_temperature = 20.0;     // degC

  /// The six error motions of every axis of the chain at `position` [m].
  [[nodiscard]] ErrorMotions motions(const Chain& chain, const Eigen::Vector3d& position) const noexcept;
};

struct Machine {
  Chain chain;
  std::array<Range, 3> travel{Range{0.0, 0.0}, Range{0.0, 0.0}, Range{0.0, 0.0}};  // m, by axis letter
  Eigen::Vector3d tool = Eigen::Vector3d::Zero();                                  // m
  std::array<double, 3> resolution{};                                              // m, one count of the axis
  std::optional<MachineErrors> errors;  // of a simulated machine; nothing when the file names none
};

/// Where the tool of a simulated machine really stands minus where it is commanded [m], by exact transforms.
/// `directions` is axis_directions(chain, errors.squareness), made once. `moving` holds +1 or -1 per axis,
/// the sense of its last motion (0: mean of both), `growth` what heat adds along each axis [m]. Real-time.
Eigen::Vector3d simulated_error(const Machine& machine, const Eigen::Matrix3d& directions,
                                const Eigen::Vector3d& position, const Eigen::Vector3d& tool,
                                const Eigen::Vector3d& moving = Eigen::Vector3d::Zero(),
                                const Eigen::Vector3d& growth = Eigen::Vector3d::Zero()) noexcept;

}  // namespace invar::metrology
