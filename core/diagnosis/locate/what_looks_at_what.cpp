#include "core/diagnosis/locate/what_looks_at_what.hpp"

#include <algorithm>
#include <cctype>
#include <set>

namespace invar::diagnosis {

using physics::Equations;

bool mentions(const std::string& formula, std::string_view name) {
  const auto part_of_name = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  for (auto at = formula.find(name); at != std::string::npos; at = formula.find(name, at + 1)) {
    const std::size_t end = at + name.size();
    if ((at == 0 || !part_of_name(formula[at - 1])) && (end == formula.size() || !part_of_name(formula[end])))
      return true;
  }
  return false;
}

bool is_kinematic(const Equations& equations, const Equations::State& state) {
  return std::any_of(equations.states.begin(), equations.states.end(),
                     [&](const auto& other) { return state.derivative == other.name; });
}

bool is_speed(const Equations& equations, const std::string& state) {
  return std::any_of(equations.states.begin(), equations.states.end(),
                     [&](const auto& other) { return other.derivative == state; });
}

bool is_static(const Equations& equations) {
  return std::all_of(equations.states.begin(), equations.states.end(),
                     [](const auto& state) { return state.derivative == "0"; });
}

bool is_used(const Equations& equations, const std::string& symbol) {
  return symbol == equations.controlled_input || mentions(equations.control_law, symbol) ||
         std::any_of(equations.states.begin(), equations.states.end(),
                     [&](const auto& state) { return mentions(state.derivative, symbol); }) ||
         std::any_of(equations.outputs.begin(), equations.outputs.end(),
                     [&](const auto& output) { return mentions(output.expression, symbol); });
}

std::vector<Equations::State> states_of_machine(const Equations& equations) {
  if (equations.controlled_input.empty()) return equations.states;
  std::vector<std::string> formulas;  // by which an output comes about
  for (const auto& output : equations.outputs) formulas.push_back(output.expression);
  std::set<std::string> seen;
  for (std::size_t k = 0; k < formulas.size(); ++k)
    for (const auto& state : equations.states)
      if (mentions(formulas[k], state.name) && seen.insert(state.name).second)
        formulas.push_back(state.derivative);
  auto states = equations.states;
  if (seen.empty()) return states;  // what shows by the controller's output alone may be either's
  std::erase_if(states, [&](const auto& state) {
    return !seen.contains(state.name) && mentions(equations.control_law, state.name);
  });
  return states;
}

}  // namespace invar::diagnosis
