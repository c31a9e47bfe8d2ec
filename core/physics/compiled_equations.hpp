// CompiledEquations: the formulas of a model in the user's own equations, and where their values stand.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "core/physics/expression.hpp"
#include "core/physics/model.hpp"

namespace invar::physics {

/// The formulas of a model, read once: reading them takes a hundred times as long as a step.
class CompiledEquations {
 public:
  explicit CompiledEquations(const Model& model);

  /// The slot of a symbol; variables() where there is none of it.
  [[nodiscard]] std::size_t place(const std::string& symbol) const {
    return static_cast<std::size_t>(std::find(names_.begin(), names_.end(), symbol) - names_.begin());
  }
  [[nodiscard]] std::size_t variables() const { return names_.size(); }

  std::unique_ptr<Expressions> formulas;
  std::vector<std::size_t> parameters;      // places in the model
  std::vector<std::size_t> rates, outputs;  // slots
  std::size_t law = 0;

 private:
  std::vector<std::string> names_;  // states, inputs, t
};

}  // namespace invar::physics
