// Names and expressions that a model in the user's own equations may hold.
#pragma once

#include <string>
#include <vector>

#include "core/config/yaml.hpp"
#include "core/physics/expression_units.hpp"
#include "core/physics/model.hpp"

namespace invar::model {

/// Faults at their lines: a word that is no name, a name that stands for two things or for a function. Likewise an expression
/// that assigns or is two, and a loop without an input to close or that follows itself.
void check_own_expressions(const config::Node& root, const physics::Model& model);

/// Where numbers that go together in an expression count in different units.
struct FormulaClash {
  std::size_t formula;   // the derivatives of the states, the outputs, the control law
  std::string what;      // with the formula and its place
  bool is_size = false;  // as of physics::UnitClash
};
/// `columns`: in which units the columns of inputs and outputs are counted, by signal.
std::vector<FormulaClash> clashes_of_units(const physics::Model& model, const physics::UnitsOfNames& columns);

/// How a clash of sizes is mended.
inline constexpr const char* mend_of_clash =
    "give all in SI, or in units that go together, or leave out the unit of a number that is meant as it "
    "stands";

}  // namespace invar::model
