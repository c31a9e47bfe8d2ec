// ComponentNetworks: the volumetric error from networks, one a component: functions of position, of position and
// temperature, or of more inputs.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "core/metrology/volumetric.hpp"
#include "core/numerics/rbf_network.hpp"
#include "core/numerics/rbf_ridge.hpp"

namespace invar::metrology {

/// One error motion as a Gaussian network: its first input is the position of its axis [m], the others are those of the
/// machine's state that it depends on.
struct ComponentNetwork {
  numerics::RbfNetwork network;
  std::vector<int> states;  // which of the machine's states (temperature, heating rate, load ..), by index
};

/// The seed's form of the volumetric error (its chapter 2 over position, 3 over temperature, 6 over more): use it where the
/// components themselves were measured, by an angular interferometer or a level, at several states of the machine. From
/// displacement lines take `identify`. Set-up and offline use; `numerics::compile` makes tables of the networks.
struct ComponentNetworks {
  Chain chain;
  Squareness squareness{};
  std::array<std::optional<ComponentNetwork>, component_count> components;  // none: zero

  [[nodiscard]] ErrorMotions motions(const Eigen::Vector3d& position, const Eigen::VectorXd& state) const;
  /// Actual minus commanded position [m] of a tool at a state of the machine, to first order with exact axis directions.
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position, const Eigen::Vector3d& tool,
                                      const Eigen::VectorXd& state) const;
};

/// Fits one component by ridge regression with GCV. `position`: N [m]; `values`: N, m or rad; `state`: states x N, of which
/// the rows `states` are inputs. Needs some readings more than inputs.
ComponentNetwork fit_component(const Eigen::Ref<const Eigen::VectorXd>& position,
                               const Eigen::Ref<const Eigen::MatrixXd>& state, std::vector<int> states,
                               const Eigen::Ref<const Eigen::VectorXd>& values,
                               const numerics::RidgeOptions& options = {});

}  // namespace invar::metrology
