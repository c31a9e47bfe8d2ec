#include "core/model/own_expressions.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <string>
#include <string_view>

#include "core/base/limits.hpp"
#include "core/base/unit.hpp"
#include "core/physics/expression.hpp"

namespace invar::model {

namespace {

using config::Node;

bool is_reserved(std::string_view name) {
  const auto& words = physics::expression_words();
  return name == "t" || std::find(words.begin(), words.end(), name) != words.end();
}

bool is_letter(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

/// States, inputs and parameters share one list of names.
class Names {
 public:
  void take(const Node& node, const std::string& what) { take(node, node.key(), what); }
  void take(const Node& node, const std::string& name, const std::string& what) {
    if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) != 0 ||
        !std::all_of(name.begin(), name.end(), is_letter))
      node.fault("`" + name + "` is no name for an expression", "use letters, digits and _, a letter first");
    else if (is_reserved(name))
      node.fault("`" + name + "` means something else in an expression", "give it another name");
    else if (const auto [at, is_new] = seen_.emplace(name, what); !is_new)
      node.fault("`" + name + "` is " + at->second + " already", "give one of the two another name");
    else
      return;
    are_good_ = false;
  }
  [[nodiscard]] bool are_good() const { return are_good_; }
  [[nodiscard]] const std::map<std::string, std::string>& all() const { return seen_; }

 private:
  std::map<std::string, std::string> seen_;
  bool are_good_ = true;
};

/// One expression: nothing is set in it, and it ends once.
bool is_one_value(const Node& node) {
  if (!node.exists()) return false;
  const auto text = node.as_text();
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i], before = i > 0 ? text[i - 1] : ' ',
               behind = i + 1 < text.size() ? text[i + 1] : ' ';
    depth += c == '(' ? 1 : c == ')' ? -1 : 0;
    const bool compares = behind == '=' || before == '=' || before == '<' || before == '>' || before == '!';
    if ((c == '=' && !compares) || c == ';' || c == '"' || (c == ',' && depth == 0)) {
      node.fault("`" + text + "`: `" + std::string{c} + "` has no place in it",
                 "write one expression that gives the value");
      return false;
    }
  }
  return true;
}

/// What a formula may speak of: the time, states, inputs and parameters.
std::vector<std::string> names_in_formulas(const physics::Model& model) {
  std::vector<std::string> names{"t"};
  for (const auto& state : model.equations.states) names.push_back(state.name);
  for (const auto& input : model.equations.inputs) names.push_back(input.symbol);
  for (const auto& parameter : model.parameters)
    if (parameter.name.find('.') == std::string::npos) names.push_back(parameter.name);
  return names;
}

/// Reads a formula as the simulation will, to say at its line what it is that cannot be read. Is it readable?
bool check_formula(const Node& node, const physics::Model& model) {
  try {
    (void)physics::Expressions{names_in_formulas(model), {}}.add(physics::Expressions::rates, node.as_text(),
                                                                 "");
  } catch (const InputError& error) {
    node.fault(error.faults().front().what, error.faults().front().mend);
    return false;
  }
  return true;
}

bool mentions(const std::string& expression, const std::string& name) {
  for (auto at = expression.find(name); at != std::string::npos; at = expression.find(name, at + 1)) {
    const auto end = at + name.size();
    if ((at == 0 || !is_letter(expression[at - 1])) &&
        (end == expression.size() || !is_letter(expression[end])))
      return true;
  }
  return false;
}

/// The units of a model's states and parameters, where they are known ones.
physics::UnitsOfNames own_units(const physics::Model& model) {
  constexpr std::string_view of_state = ".initial";
  physics::UnitsOfNames units{{"t", {"s", *parse_unit("s")}}};
  for (const auto& parameter : model.parameters) {
    std::string_view name = parameter.name;
    if (name.ends_with(of_state)) name.remove_suffix(of_state.size());
    const auto unit = parse_unit(parameter.unit);
    const bool says_none = parameter.unit == "1" || parameter.unit == "-" || parameter.unit.empty();
    if (unit && !says_none) units[std::string{name}] = {parameter.unit, *unit};
  }
  return units;
}

/// What a formula is, and where it stands in the model.
struct Formula {
  std::string place, text;
  std::optional<physics::NamedUnit> result;
};

std::vector<Formula> formulas_of(const physics::Model& model, const physics::UnitsOfNames& units,
                                 const physics::UnitsOfNames& columns) {
  std::vector<Formula> all;
  for (const auto& state : model.equations.states) {
    Formula formula{"states." + state.name + ".derivative", state.derivative, {}};
    if (const auto at = units.find(state.name); at != units.end()) {
      formula.result = {"a rate of `" + state.name + "` [" + at->second.text + "] in a second",
                        at->second.unit};
      formula.result->unit.dimension[2] -= 1.0;
    }
    all.push_back(formula);
  }
  for (const auto& output : model.equations.outputs) {
    Formula formula{"outputs." + output.name + ".expression", output.expression, {}};
    if (const auto at = columns.find(output.name); at != columns.end())
      formula.result = {"its column [" + at->second.text + "]", at->second.unit};
    all.push_back(formula);
  }
  if (!model.equations.controlled_input.empty())
    all.push_back({"controller.expression", model.equations.control_law, {}});
  return all;
}

}  // namespace

void check_own_expressions(const Node& root, const physics::Model& model) {
  if (model.equations.states.size() + model.equations.inputs.size() + model.equations.outputs.size() +
          model.parameters.size() >
      limits::equation_names) {
    root.fault("names more than " + std::to_string(limits::equation_names) +
                   " states, inputs, outputs and parameters",
               "take fewer: each formula is read with all of them");
    return;
  }
  Names names;
  std::vector<Node> formulas;
  for (const auto& node : root["states"].children()) {
    names.take(node, "a state");
    formulas.push_back(node["derivative"]);
  }
  for (const auto& node : root["inputs"].children()) names.take(node, "an input");
  for (const auto& node : root["parameters"].children()) names.take(node, "a parameter");
  if (const auto& decided = model.equations.controlled_input;
      !decided.empty() && !root["inputs"].has(decided))
    names.take(root["controller"]["output"], decided, "an input");
  for (const auto& node : root["outputs"].children()) {
    formulas.push_back(node["expression"]);
    if (const auto at = names.all().find(node.key()); at != names.all().end() && at->second == "an input")
      node.fault("`" + node.key() + "` is an input already", "give the output another name");
  }
  if (root.has("controller")) formulas.push_back(root["controller"]["expression"]);
  bool are_readable = names.are_good();
  for (const auto& node : formulas)
    are_readable = is_one_value(node) && names.are_good() && check_formula(node, model) && are_readable;
  if (model.equations.states.empty() && model.equations.inputs.empty())
    root.fault("names no state and no input", "add `inputs` that the outputs go with, or `states`");
  if (model.equations.outputs.empty())
    root["outputs"].fault("names no output", "add one, with column and expression");
  if (are_readable)
    for (const auto& clash : clashes_of_units(model, {}))
      if (clash.is_size) formulas[clash.formula].fault(clash.what, mend_of_clash);
  const auto& output = model.equations.controlled_input;
  if (output.empty()) return;
  const auto controller = root["controller"];
  const auto drives = [&](const Node& node) { return node.exists() && mentions(node.as_text(), output); };
  if (!root["inputs"].has(output) && std::none_of(formulas.begin(), formulas.end() - 1, drives))
    controller["output"].fault("`" + output + "` is no input of this model and drives none of its states",
                               "name one of `inputs`, or what a derivative uses");
  else if (mentions(model.equations.control_law, output))
    controller["expression"].fault("`" + output + "` follows from itself",
                                   "write it from states, other inputs and parameters");
}

std::vector<FormulaClash> clashes_of_units(const physics::Model& model,
                                           const physics::UnitsOfNames& columns) {
  auto units = own_units(model);
  for (const auto& input : model.equations.inputs)
    if (const auto at = columns.find(input.signal); at != columns.end()) units[input.symbol] = at->second;
  const auto names = names_in_formulas(model);
  std::vector<FormulaClash> clashes;
  const auto formulas = formulas_of(model, units, columns);
  for (std::size_t i = 0; i < formulas.size(); ++i)
    if (const auto clash = physics::clash_of_units(formulas[i].text, units, names, formulas[i].result))
      clashes.push_back(
          {i, "`" + formulas[i].place + ": " + formulas[i].text + "`: " + clash->what, clash->is_size});
  return clashes;
}

}  // namespace invar::model
