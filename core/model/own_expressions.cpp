#include "core/model/own_expressions.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <string>
#include <string_view>

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

/// Reads a formula as the simulation will, to say at its line what it is that cannot be read.
void check_formula(const Node& node, const physics::Model& model) {
  if (!node.exists()) return;
  std::vector<std::string> variables{"t"}, constants;
  for (const auto& state : model.equations.states) variables.push_back(state.name);
  for (const auto& input : model.equations.inputs) variables.push_back(input.symbol);
  for (const auto& parameter : model.parameters)
    if (parameter.name.find('.') == std::string::npos) constants.push_back(parameter.name);
  try {
    (void)physics::Expressions{variables, constants}.add(physics::Expressions::rates, node.as_text(), "");
  } catch (const InputError& error) {
    node.fault(error.faults().front().what, error.faults().front().mend);
  }
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

/// Nothing converts between the states: one whose rate is another as it stands is in that one's unit, times a second.
void check_rate(const Node& node, const physics::Model& model) {
  auto rate = node.text("derivative", "");
  std::erase(rate, ' ');
  const auto *of_state = model.find(node.key() + ".initial"), *of_rate = model.find(rate + ".initial");
  if (of_state == nullptr || of_rate == nullptr || of_state->unit == "1" || of_rate->unit == "1") return;
  const auto needed = parse_unit("(" + of_state->unit + ")/s"), there = parse_unit(of_rate->unit);
  if (!needed || !there || !needed->same_quantity(*there)) return;
  if (std::abs(needed->factor / there->factor - 1.0) < 1e-9) return;
  node["initial"].fault(
      "is in " + of_state->unit + ", and its rate `" + rate + "` in " + of_rate->unit +
          ", between which nothing converts",
      "give `" + rate + "` in " + of_state->unit + "/s, or `" + node.key() + "` to suit it");
}

}  // namespace

void check_own_expressions(const Node& root, const physics::Model& model) {
  Names names;
  std::vector<Node> formulas;
  for (const auto& node : root["states"].children()) {
    names.take(node, "a state");
    formulas.push_back(node["derivative"]);
    check_rate(node, model);
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
  for (const auto& node : formulas)
    if (is_one_value(node) && names.are_good()) check_formula(node, model);
  if (model.equations.states.empty())
    root["states"].fault("names no state", "add one, with derivative and initial");
  if (model.equations.outputs.empty())
    root["outputs"].fault("names no output", "add one, with column and expression");
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

}  // namespace invar::model
