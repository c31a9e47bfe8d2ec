#include "core/physics/compiled_equations.hpp"

namespace invar::physics {

CompiledEquations::CompiledEquations(const Model& model) {
  const auto& equations = model.equations;
  for (const auto& state : equations.states) names_.push_back(state.name);
  for (const auto& input : equations.inputs) names_.push_back(input.symbol);
  names_.emplace_back("t");
  std::vector<std::string> constants;
  for (std::size_t i = 0; i < model.parameters.size(); ++i)
    if (model.parameters[i].name.find('.') == std::string::npos) {
      parameters.push_back(i);
      constants.push_back(model.parameters[i].name);
    }
  formulas = std::make_unique<Expressions>(names_, constants);
  for (const auto& state : equations.states)
    rates.push_back(formulas->add(Expressions::rates, state.derivative, "states." + state.name));
  for (const auto& output : equations.outputs)
    outputs.push_back(formulas->add(Expressions::outputs, output.expression, "outputs." + output.name));
  if (!equations.controlled_input.empty())
    law = formulas->add(Expressions::law, equations.control_law, "controller.expression");
}

}  // namespace invar::physics
