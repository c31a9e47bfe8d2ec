// Rows that were taken at even steps beside time stamps that scatter, as a computer writes them when it gets round to it.
#pragma once

#include <string>
#include <vector>

#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Puts the rows onto even steps where their stamps scatter about such steps; with a clause in `doubts`. A moving output must go
/// far more smoothly over the steps than over the stamps. For machines that move on from row to row without a controller that
/// ticks by itself. `record.time` in order.
void even_out(const physics::Model& model, physics::Record& record, const std::string& file,
              std::vector<std::string>& doubts);

}  // namespace invar::diagnosis
