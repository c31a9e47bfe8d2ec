// The simulations of the plants; `prepare` chooses among them.
#pragma once

#include "core/physics/simulation.hpp"

namespace invar::physics {

/// A row from which on a run goes on from other states.
struct Restart {
  std::size_t row = 0;
  std::vector<std::size_t> parameters;  // of the model, by state
};
/// Preconditions: `structure` has a parameter for each state at each restart of `inputs`.
std::vector<Restart> restarts_of(const Model& structure, const Record& inputs);

std::unique_ptr<Simulation> prepare_axis(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_thermal(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_error_map(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_droplet(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_sensor(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_equations(const Model& structure, const Record& inputs);

}  // namespace invar::physics
