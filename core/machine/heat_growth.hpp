// Thermal error of a simulated machine: the physics terms of error maps, with the machine file's numbers.
#pragma once

#include <Eigen/Core>

#include "core/metrology/geometric/machine.hpp"

namespace invar::machine {

/// Displacement along each axis [m] at `position` [m], for a scale at `scale_temperature` and a base at `base_temperature`
/// [degC]. It is the expansion and bending of the scale plus the expansion of the base; zero for a machine without
/// errors. Real-time.
Eigen::Vector3d heat_growth(const metrology::Machine& machine, const Eigen::Vector3d& position,
                            double scale_temperature, double base_temperature) noexcept;

}  // namespace invar::machine
