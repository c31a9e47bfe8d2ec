// What terms at the inputs and outputs of a model in the user's own equations do to whole columns.
#pragma once

#include <string>
#include <vector>

#include "core/physics/model.hpp"

namespace invar::physics {

/// What passes a limit of one column goes, in part, to another. `names` are those of the columns.
void run_over(const Model& model, const std::vector<std::string>& names,
              std::vector<std::vector<double>>& columns);

/// Terms `on` this signal bend its column. `held`: from row to row, as an input is.
void bend(const Model& model, const std::string& on, const std::vector<double>& time,
          std::vector<double>& values, bool held);

}  // namespace invar::physics
