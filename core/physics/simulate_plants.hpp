// The simulations of the plants; `prepare` chooses among them.
#pragma once

#include "core/physics/simulation.hpp"

namespace invar::physics {

std::unique_ptr<Simulation> prepare_axis(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_thermal(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_error_map(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_droplet(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_sensor(const Model& structure, const Record& inputs);
std::unique_ptr<Simulation> prepare_equations(const Model& structure, const Record& inputs);

}  // namespace invar::physics
