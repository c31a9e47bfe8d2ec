// `invar types`: the component types that a cell file can name, with ports and parameters; nothing needs to run.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "components/all.hpp"
#include "core/base/shown.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/wire_type.hpp"
#include "core/recording/type_book.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/plugins.hpp"
#include "tools/command.hpp"
#include "tools/live/parameter_json.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct TypesOptions {
  std::string type;
  std::vector<std::filesystem::path> plugins;
  std::filesystem::path cell;
  bool json = false;
};

/// A component type as far as it can be known: ports may follow from parameters.
struct Type {
  std::string name, description;
  std::vector<ParameterInfo> parameters;
  std::vector<RegisterInfo> registers;
  const Component* example = nullptr;  // with the ports that it shows
  std::string why_no_ports;
  std::unique_ptr<Component> made;
  std::shared_ptr<void> storage;  // its parameters
};

/// The first component of a type in a cell.
const Component* example_in(const LoadedCell& cell, const std::string& type) {
  for (const LoadedProcess& process : cell.processes)
    for (const LoadedComponent& member : process.components)
      if (member.component && member.file->type == type) return member.component.get();
  return nullptr;
}

Type look_at(const Registry& registry, const std::string& name, const LoadedCell* cell) {
  Type type{name, registry.description(name), {}, registry.registers(name), nullptr, "", nullptr, nullptr};
  const auto nothing = config::Yaml::parse("{}", name);
  Prepared prepared = registry.prepare(name, nothing.root(), {});
  type.parameters = std::move(prepared.infos);
  type.storage = prepared.parameters;
  if (cell != nullptr) type.example = example_in(*cell, name);
  if (type.example != nullptr) return type;
  try {  // what is missing of its parameters need not be what its ports follow from
    if (prepared.make) type.made = prepared.make();
    type.example = type.made.get();
  } catch (const InputError& error) {
    type.why_no_ports = error.faults().front().line();
  }
  return type;
}

std::string data_of(const Port& port) {
  const auto* wire = dds::WireTypes::all().find(port.type());
  return wire == nullptr ? "?" : wire->name();
}

std::string direction_of(const Port& port) {
  switch (port.direction()) {
    case Port::Direction::input:
      return "input";
    case Port::Direction::inbox:
      return "inbox";
    case Port::Direction::output:
      break;
  }
  return "output";
}

const InputOptions* options_of(const Port& port) {
  const auto* input = dynamic_cast<const InputPort*>(&port);
  return input == nullptr ? nullptr : &input->options();
}

std::string bounds_of(const ParameterInfo& info) {
  if (!std::isfinite(info.range.lower) && !std::isfinite(info.range.upper)) return "";
  return "[" + shown(info.range.lower) + ", " + shown(info.range.upper) + "]";
}

std::string word_of(const recording::Type& type) {
  using enum recording::Kind;
  switch (type.kind) {
    case boolean:
      return "boolean";
    case float32:
    case float64:
      return "number";
    case string:
      return "text";
    case enumeration:
    case structure:
      return type.name;
    case sequence:
      return "list of " + word_of(*type.element);
    case array:
      return std::to_string(type.bound) + " of " + word_of(*type.element);
    default:
      return "whole number";
  }
}

nlohmann::ordered_json fields_of(const std::string& data) {
  auto fields = nlohmann::ordered_json::array();
  if (const auto* known = recording::built_in_type(data))
    for (const auto& member : known->type->members)
      fields.push_back({{"name", member.name},
                        {"type", word_of(*member.type)},
                        {"unit", member.unit},
                        {"key", member.key}});
  return fields;
}

nlohmann::ordered_json type_json(const Type& type) {
  nlohmann::ordered_json json{{"type", type.name},
                              {"description", type.description},
                              {"ports", nlohmann::ordered_json::array()},
                              {"parameters", nlohmann::ordered_json::array()}};
  if (!type.why_no_ports.empty()) json["ports_unknown"] = type.why_no_ports;
  if (type.example != nullptr)
    for (const Port* port : type.example->ports()) {
      const auto* input = options_of(*port);
      json["ports"].push_back({{"name", port->name()},
                               {"direction", direction_of(*port)},
                               {"data", data_of(*port)},
                               {"profile", port->profile},
                               {"optional", input != nullptr && input->optional},
                               {"deadline_ns", input != nullptr ? input->deadline.ns : 0},
                               {"fields", fields_of(data_of(*port))}});
    }
  for (const ParameterInfo& info : type.parameters)
    json["parameters"].push_back(json_of(ShownParameter{.component = "",
                                                          .path = info.path,
                                                          .type = info.type,
                                                          .unit = info.unit,
                                                          .value = "",
                                                          .otherwise = info.otherwise,
                                                          .range = info.range,
                                                          .while_running = info.changeable,
                                                          .description = info.description}));
  if (!type.registers.empty()) json["registers"] = nlohmann::ordered_json::array();
  for (const RegisterInfo& info : type.registers)
    json["registers"].push_back({{"name", info.name},
                                 {"unit", info.unit},
                                 {"access", info.access},
                                 {"need", info.need},
                                 {"description", info.description}});
  return json;
}

void print_type(const Type& type) {
  std::cout << type.name << ": " << type.description << "\n\n";
  TextTable ports{{"port", "direction", "data", "profile", ""}};
  std::vector<std::string> data;
  if (type.example != nullptr)
    for (const Port* port : type.example->ports()) {
      const auto* input = options_of(*port);
      std::string more = input != nullptr && input->optional ? "optional" : "";
      if (input != nullptr && input->deadline.ns > 0)
        more += (more.empty() ? "" : ", ") + ("safe without it after " + milliseconds(input->deadline));
      ports.add({port->name(), direction_of(*port), data_of(*port), port->profile, more});
      if (std::find(data.begin(), data.end(), data_of(*port)) == data.end()) data.push_back(data_of(*port));
    }
  if (!type.why_no_ports.empty())
    std::cout << "its ports follow from parameters that have no default (" << type.why_no_ports
              << "); --cell shows those that it has in a cell\n";
  else if (ports.empty())
    std::cout << "without its parameters it has no ports\n";
  else
    ports.print(std::cout);
  std::cout << '\n';
  TextTable parameters{{"parameter", "type", "unit", "bounds", "default", "while running", "what"}};
  for (const ParameterInfo& info : type.parameters)
    parameters.add({info.path, info.type, info.unit, bounds_of(info), info.otherwise,
                    info.changeable ? "yes" : "", info.description});
  if (parameters.empty())
    std::cout << "no parameters\n";
  else
    parameters.print(std::cout);
  if (!type.registers.empty()) {
    TextTable registers{{"register of its map", "unit", "access", "need", "what"}};
    for (const RegisterInfo& info : type.registers)
      registers.add({info.name, info.unit, info.access, info.need, info.description});
    std::cout << '\n';
    registers.print(std::cout);
    std::cout << "(any unit that measures the same will do: degF for degC, mW for W)\n";
  }
  for (const std::string& name : data) {
    const auto fields = fields_of(name);
    if (fields.empty()) continue;
    std::cout << '\n' << name << '\n';
    for (const auto& field : fields)
      print_wrapped("  " + field["name"].get<std::string>() + ": " + field["type"].get<std::string>() +
                        (field["unit"] == "" ? "" : " [" + field["unit"].get<std::string>() + "]") +
                        (field["key"] ? ", key" : ""),
                    4, std::cout);
  }
}

void types(const TypesOptions& options) {
  std::optional<LoadedCell> cell;
  if (!options.cell.empty()) cell = load_cell(options.cell);
  Registry own;
  Registry& registry = cell ? *cell->registry : own;
  if (!cell) add_all_components(registry);
  for (const auto& plugin : options.plugins)
    if (const Fault fault = load_plugin(plugin, registry); !fault.what.empty())
      throw InputError{std::vector{fault}};
  if (!options.type.empty() && !registry.has(options.type))
    throw InputError{"TYPE", "`" + clipped(options.type) + "` is no component type",
                     config::mend_name(options.type, registry.names())};
  if (!options.type.empty()) {
    const Type type = look_at(registry, options.type, cell ? &*cell : nullptr);
    if (options.json)
      std::cout << type_json(type).dump(2) << '\n';
    else
      print_type(type);
    return;
  }
  TextTable table{{"type", "ports>", "parameters>", "what"}};
  auto json = nlohmann::ordered_json::array();
  for (const auto& name : registry.names()) {
    const Type type = look_at(registry, name, cell ? &*cell : nullptr);
    if (options.json) json.push_back(type_json(type));
    table.add({name, type.example != nullptr ? std::to_string(type.example->ports().size()) : "-",
               std::to_string(type.parameters.size()), type.description});
  }
  if (options.json)
    std::cout << json.dump(2) << '\n';
  else
    table.print(std::cout);
}

}  // namespace

void add_types(CLI::App& program) {
  auto* command = program.add_subcommand(
      "types", "List the component types that a cell can have, their ports and parameters");
  command->footer(
      "Example: invar types stage\n"
      "         invar types simulated_stage --cell deployment/xy-table.yaml\n"
      "         invar types --plugin liblow_pass.so low_pass --json\n"
      "Without TYPE one line a type. Where ports follow from parameters (axes, a machine's file), those of "
      "the "
      "defaults are shown,\n"
      "with --cell those of that cell's first component of the type.\n"
      "Exit status: 0; 2 a fault of the call or the library");
  auto options = std::make_shared<TypesOptions>();
  command->add_option("type", options->type, "all of this one");
  command->add_option("--plugin", options->plugins, "also those of this library; may stand several times")
      ->allow_extra_args(false);
  command->add_option("--cell", options->cell,
                      "with this cell's libraries, and ports as its components have them");
  command->add_flag("--json", options->json, "print it as JSON, with the fields of the data and their units");
  command->callback([options] { types(*options); });
}

}  // namespace invar::tools
