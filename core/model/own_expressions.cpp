#include "core/model/own_expressions.hpp"

#include <algorithm>
#include <cctype>
#include <map>
#include <string>
#include <string_view>

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
  void take(const Node& node, const std::string& what) {
    const auto name = node.key();
    if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) != 0 ||
        !std::all_of(name.begin(), name.end(), is_letter))
      node.fault("`" + name + "` is no name for an expression", "use letters, digits and _, a letter first");
    else if (is_reserved(name))
      node.fault("`" + name + "` means something else in an expression", "give it another name");
    else if (const auto [at, is_new] = seen_.emplace(name, what); !is_new)
      node.fault("`" + name + "` is " + at->second + " already", "give one of the two another name");
  }
  [[nodiscard]] const std::map<std::string, std::string>& all() const { return seen_; }

 private:
  std::map<std::string, std::string> seen_;
};

/// One expression: nothing is set in it, and it ends once.
void check(const Node& node) {
  if (!node.exists()) return;
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
      return;
    }
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

}  // namespace

void check_own_expressions(const Node& root, const physics::Model& model) {
  Names names;
  for (const auto& node : root["states"].children()) {
    names.take(node, "a state");
    check(node["derivative"]);
  }
  for (const auto& node : root["inputs"].children()) names.take(node, "an input");
  for (const auto& node : root["parameters"].children()) names.take(node, "a parameter");
  for (const auto& node : root["outputs"].children()) {
    check(node["expression"]);
    if (const auto at = names.all().find(node.key()); at != names.all().end() && at->second == "an input")
      node.fault("`" + node.key() + "` is an input already", "give the output another name");
  }
  if (model.equations.states.empty())
    root["states"].fault("names no state", "add one, with derivative and initial");
  if (model.equations.outputs.empty())
    root["outputs"].fault("names no output", "add one, with column and expression");
  if (!root.has("controller")) return;
  const auto controller = root["controller"];
  check(controller["expression"]);
  const auto& output = model.equations.controlled_input;
  const auto at = names.all().find(output);
  if (at == names.all().end() || at->second != "an input")
    controller["output"].fault("`" + output + "` is no input of this model", "name one of `inputs`");
  else if (mentions(model.equations.control_law, output))
    controller["expression"].fault("`" + output + "` follows from itself",
                                   "write it from states, other inputs and parameters");
}

}  // namespace invar::model
