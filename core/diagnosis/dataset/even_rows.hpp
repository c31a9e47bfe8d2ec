// Rows that were taken at even steps beside time stamps that scatter, as a computer writes them when it gets round to it.
#pragma once

#include <string>
#include <vector>

#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Puts the rows onto even steps where their stamps scatter about such and an output that moves goes far more smoothly over
/// these than over the stamps; with a clause in `doubts`. Of machines that move on from row to row without a controller that
/// ticks by itself. `record.time` in order.
void even_out(const physics::Model& model, physics::Record& record, const std::string& file,
              std::vector<std::string>& doubts);

}  // namespace invar::diagnosis
