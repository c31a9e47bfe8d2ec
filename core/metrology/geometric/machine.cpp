#include "core/metrology/geometric/machine.hpp"

namespace invar::metrology {

ErrorMotions MachineErrors::motions(const Chain& chain, const Eigen::Vector3d& position) const noexcept {
  ErrorMotions result;
  for (int place = 0; place < chain.axes; ++place) {
    const int axis = chain.order[static_cast<std::size_t>(place)];
    ErrorMotion& motion = result[static_cast<std::size_t>(axis)];
    for (int direction = 0; direction < 3; ++direction) {
      motion.translation[direction] =
          functions[static_cast<std::size_t>(metrology::translation(direction, axis))](position[axis]);
      motion.rotation[direction] =
          functions[static_cast<std::size_t>(metrology::rotation(direction, axis))](position[axis]);
    }
  }
  return result;
}

Eigen::Vector3d simulated_error(const Machine& machine, const Eigen::Matrix3d& directions,
                                const Eigen::Vector3d& position, const Eigen::Vector3d& tool,
                                const Eigen::Vector3d& moving, const Eigen::Vector3d& growth) noexcept {
  if (!machine.errors) return Eigen::Vector3d::Zero();
  const MachineErrors& errors = *machine.errors;
  ErrorMotions motions = errors.motions(machine.chain, position);
  for (int axis = 0; axis < 3; ++axis) {
    if (!machine.chain.has(axis)) continue;
    const auto a = static_cast<std::size_t>(axis);
    motions[a].translation[axis] += growth[axis] + 0.5 * errors.reversal[a](position[axis]) * moving[axis];
  }
  return exact_error(machine.chain, directions, position, motions, tool);
}

}  // namespace invar::metrology
