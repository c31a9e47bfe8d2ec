#include "core/metrology/component_networks.hpp"

#include <utility>

namespace invar::metrology {

ErrorMotions ComponentNetworks::motions(const Eigen::Vector3d& position, const Eigen::VectorXd& state) const {
  ErrorMotions result;
  for (int c = 0; c < component_count; ++c) {
    const auto& component = components[static_cast<std::size_t>(c)];
    if (!component || !chain.has(axis_of(c))) continue;
    Eigen::VectorXd input(1 + static_cast<Eigen::Index>(component->states.size()));
    input[0] = position[axis_of(c)];
    for (std::size_t i = 0; i < component->states.size(); ++i)
      input[1 + static_cast<Eigen::Index>(i)] = state[component->states[i]];
    ErrorMotion& motion = result[static_cast<std::size_t>(axis_of(c))];
    (is_rotation(c) ? motion.rotation : motion.translation)[direction_of(c)] = component->network(input);
  }
  return result;
}

Eigen::Vector3d ComponentNetworks::error(const Eigen::Vector3d& position, const Eigen::Vector3d& tool,
                                         const Eigen::VectorXd& state) const {
  return linear_error(chain, axis_directions(chain, squareness), position, motions(position, state), tool);
}

ComponentNetwork fit_component(const Eigen::Ref<const Eigen::VectorXd>& position,
                               const Eigen::Ref<const Eigen::MatrixXd>& state, std::vector<int> states,
                               const Eigen::Ref<const Eigen::VectorXd>& values,
                               const numerics::RidgeOptions& options) {
  Eigen::MatrixXd inputs(1 + static_cast<Eigen::Index>(states.size()), position.size());
  inputs.row(0) = position.transpose();
  for (std::size_t i = 0; i < states.size(); ++i)
    inputs.row(1 + static_cast<Eigen::Index>(i)) = state.row(states[i]);
  return {numerics::fit_ridge(inputs, values, options).network, std::move(states)};
}

}  // namespace invar::metrology
