#include "core/modbus/fault_script.hpp"

#include <array>
#include <string_view>

#include "core/config/yaml.hpp"

namespace invar::modbus {

namespace {

using config::Node;

constexpr Range any_time{0.0, 1e7};     // [s]
constexpr Range any_length{1e-3, 1e7};  // [s]

FaultKind kind_of(const Node& node) {
  const std::string word = node.choice(
      "do", {"drop", "refuse", "lose_answer", "delay", "exception", "freeze", "garbage", "cut_short"});
  if (word == "refuse") return FaultKind::refuse;
  if (word == "lose_answer") return FaultKind::lose_answer;
  if (word == "delay") return FaultKind::delay;
  if (word == "exception") return FaultKind::exception;
  if (word == "freeze") return FaultKind::freeze;
  if (word == "garbage") return FaultKind::garbage;
  return word == "cut_short" ? FaultKind::cut_short : FaultKind::drop;
}

ScriptedFault read_fault(const Node& node, const RegisterMap& map) {
  ScriptedFault fault;
  fault.at = Duration::seconds(node.number("at", "s", any_time));
  fault.length = Duration::seconds(node.number("for", "s", any_length));
  fault.kind = kind_of(node);
  const bool takes_register = fault.kind == FaultKind::freeze || fault.kind == FaultKind::exception;
  if (const Node reg = node["register"]; reg.exists()) {
    const std::string name = reg.as_text();
    fault.reg = map.find(name);
    if (!takes_register) {
      reg.fault("only freeze and exception concern one register", "remove `register`");
    } else if (!fault.reg) {
      std::vector<std::string> names;
      for (const auto& known : map.registers) names.push_back(known.name);
      const std::string near = config::nearest(name, names);
      reg.fault("device `" + map.device + "` has no register `" + name + "`",
                near.empty() ? "name one of its map" : "did you mean `" + near + "`?");
    } else if (fault.kind == FaultKind::freeze && map.registers[*fault.reg].writable) {
      reg.fault("`" + name + "` is written by the master", "freeze a register with `access: read`");
    }
  } else if (fault.kind == FaultKind::freeze) {
    node.fault("freeze needs the register that stands still", "add `register: ...`");
  }
  if (fault.kind == FaultKind::exception)
    fault.code = static_cast<std::uint8_t>(node.integer("code", 1, 11));
  else if (const Node code = node["code"]; code.exists())
    code.fault("only an exception has a code", "remove `code`");
  if (fault.kind == FaultKind::delay)
    fault.by = Duration::seconds(node.number("by", "s", {1e-3, 3600}));
  else if (const Node by = node["by"]; by.exists())
    by.fault("only a delay has a length `by`", "remove `by`");
  if (const Node on = node["on"]; on.exists()) {
    const std::string which = on.as_choice({"all", "reads", "writes"});
    if (fault.kind == FaultKind::refuse || fault.kind == FaultKind::freeze)
      on.fault("refuse and freeze concern no request", "remove `on`");
    fault.on_reads = which != "writes";
    fault.on_writes = which != "reads";
  }
  return fault;
}

FaultScript read(const config::Yaml& yaml, const RegisterMap& map) {
  const Node root = yaml.root();
  (void)root.integer("invar_modbus_faults", 1, 1);
  FaultScript script;
  const Node faults = root.required("faults");
  if (faults.exists() && !faults.is_list())
    faults.fault("a list is expected here", "write `- {at: 10, for: 2, do: refuse}` below it");
  else
    for (const Node& node : faults.children()) script.push_back(read_fault(node, map));
  yaml.finish();
  return script;
}

}  // namespace

FaultScript load_faults(const std::filesystem::path& file, const RegisterMap& map) {
  return read(config::Yaml::load(file), map);
}
FaultScript parse_faults(const std::string& text, const std::string& name, const RegisterMap& map) {
  return read(config::Yaml::parse(text, name), map);
}

}  // namespace invar::modbus
