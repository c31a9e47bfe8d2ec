#include "core/machine/heat_growth.hpp"

#include "core/physics/terms/error_map/heat_bending.hpp"
#include "core/physics/terms/error_map/thermal_expansion.hpp"

namespace invar::machine {

Eigen::Vector3d heat_growth(const metrology::Machine& machine, const Eigen::Vector3d& position,
                            double scale_temperature, double base_temperature) noexcept {
  using physics::error_map::HeatBending;
  using physics::error_map::ThermalExpansion;
  Eigen::Vector3d growth = Eigen::Vector3d::Zero();
  if (!machine.errors) return growth;
  const metrology::MachineErrors& errors = *machine.errors;
  for (int axis = 0; axis < metrology::axis_count; ++axis) {
    if (!machine.chain.has(axis)) continue;
    const auto a = static_cast<std::size_t>(axis);
    physics::MapPoint at;
    at.position = position[axis];
    at.first = machine.travel[a].lower;
    at.last = machine.travel[a].upper;
    at.warmth = scale_temperature - errors.reference_temperature;
    growth[axis] =
        ThermalExpansion::error(at, &errors.expansion[a]) + HeatBending::error(at, &errors.bending[a]);
    at.warmth = base_temperature - errors.reference_temperature;
    growth[axis] += ThermalExpansion::error(at, &errors.base_expansion[a]);
  }
  return growth;
}

}  // namespace invar::machine
