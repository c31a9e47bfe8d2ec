#include "core/model/model_file.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "core/base/limits.hpp"
#include "core/base/unit.hpp"
#include "core/model/own_expressions.hpp"
#include "core/model/term_file.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::model {

namespace {

using config::Node;
using physics::Model;
using physics::Parameter;
using physics::Plant;
using physics::Signal;
using physics::Term;

struct SignalRow {
  const char* name;
  const char* unit;
  bool is_output;
  bool required;
};

/// The signals that `columns` of a plant may name.
std::vector<SignalRow> signal_rows(Plant plant, bool closed_loop) {
  switch (plant) {
    case Plant::axis:
      return {{"time", "s", false, true},         {"reference", "m", false, closed_loop},
              {"position", "m", true, true},      {"current", "A", closed_loop, true},
              {"feedforward", "A", false, false}, {"temperature", "degC", false, false}};
    case Plant::thermal:
      return {
          {"time", "s", false, true}, {"speed", "m/s", false, false}, {"motor_current", "A", false, false}};
    case Plant::error_map:
      return {{"time", "s", false, true},        {"position", "m", false, true},
              {"direction", "1", false, false},  {"temperature", "degC", false, false},
              {"pressure", "hPa", false, false}, {"offset", "m", false, false},
              {"error", "m", true, true}};
    case Plant::droplet:
      return {{"time", "s", false, true},          {"target_x", "m", false, true},
              {"target_y", "m", false, true},      {"height", "m", false, true},
              {"velocity_x", "m/s", false, false}, {"velocity_y", "m/s", false, false},
              {"pressure", "Pa", false, false},    {"on_time", "s", false, false},
              {"image_x", "px", false, false},     {"image_y", "px", false, false},
              {"landed_x", "m", true, true},       {"landed_y", "m", true, true},
              {"diameter", "m", true, false}};
    case Plant::sensor:
      return {{"time", "s", false, true},
              {"true_position", "m", false, true},
              {"encoder", "m", true, false},
              {"velocity_sensor", "m/s", true, false}};
    case Plant::equations:
      return {{"time", "s", false, true}};
  }
  return {};
}

void read_columns(const Node& root, Model& model) {
  const auto columns = root.required("columns");
  if (columns.has("rate")) {
    model.row_rate = columns.number("rate", "Hz", Range::positive());
    if (columns.has("time"))
      columns["rate"].fault("stands beside `time`",
                            "leave one of them out: rows have a time or follow evenly");
    else
      model.signals.push_back({"time", "time", "s", false});
  }
  for (const auto& row : signal_rows(model.plant, model.controller.has_value())) {
    if (!columns.has(row.name)) {
      const bool is_time = row.name == std::string{"time"};
      if (row.required && !(is_time && model.row_rate))
        columns[row.name].missing(std::string{"add `"} + row.name + ": <column of the recording>`" +
                                  (is_time ? ", or `rate: <rows a second>`" : ""));
      continue;
    }
    model.signals.push_back({row.name, columns.text(row.name), row.unit, row.is_output});
  }
  if (model.plant == Plant::error_map)
    for (const auto& column : columns.children())
      if (physics::is_temperature(column.key()) && model.signal(column.key()) == nullptr)
        model.signals.push_back({column.key(), column.as_text(), "degC", false});
}

void add_parameter(Model& model, std::string name, std::string unit, const Node& node, Range bounds) {
  const auto quantity = node.as_quantity(unit, bounds);
  model.parameters.push_back({std::move(name), std::move(unit), quantity.value, quantity.sigma, bounds});
}

struct ParameterRow {
  const char* name;
  const char* unit;
  Range bounds;
  bool required;
};

std::vector<ParameterRow> parameter_rows(Plant plant) {
  const Range any{};
  switch (plant) {
    case Plant::axis:
      return {{"mass", "kg", {1e-6, 1e6}, true},
              {"motor_constant", "N/A", {1e-6, 1e6}, true},
              {"viscous_damping", "N s/m", {0.0, 1e7}, true}};
    case Plant::error_map:
      return {{"reference_temperature", "degC", {-100.0, 500.0}, false},
              {"expansion", "1/K", {-1e-2, 1e-2}, false}};
    case Plant::droplet:
      return {{"placement_error_x", "m", any, false}, {"placement_error_y", "m", any, false},
              {"slope_x", "1", any, false},           {"slope_y", "1", any, false},
              {"speed", "m/s", {1e-3, 1e3}, false},   {"camera_scale", "m/px", {1e-12, 1.0}, false}};
    case Plant::sensor:
      return {{"resolution", "m", {0.0, 1.0}, false}, {"gain", "1", {1e-6, 1e6}, false}};
    default:
      return {};
  }
}

/// What the file says under `unit` of a parameter; nothing where it says none that is known.
std::optional<Unit> unit_said(const Node& node) {
  if (!node.is_map() || !node.has("unit")) return std::nullopt;
  return parse_unit(node.text("unit"));
}

/// An axis whose mass is a moment of inertia turns, and so does a sensor that resolves angles.
bool turns(const Node& parameters, Plant plant) {
  const char* tells = plant == Plant::axis ? "mass" : plant == Plant::sensor ? "resolution" : nullptr;
  if (tells == nullptr || !parameters.has(tells)) return false;
  const auto said = unit_said(parameters[tells]);
  return said && said->dimension == parse_unit(plant == Plant::axis ? "kg m2" : "rad")->dimension;
}

void read_parameters(const Node& root, Model& model) {
  const auto node = root["parameters"];
  const bool is_turning = turns(node, model.plant);
  if (is_turning) physics::count_in_angles(model);
  for (const auto& row : parameter_rows(model.plant)) {
    if (!node.has(row.name)) {
      if (row.required)
        node[row.name].missing(std::string{"add `"} + row.name + ": {value: ..., unit: " + row.unit +
                               ", sigma: ...}`");
      continue;
    }
    std::string unit = row.unit;
    // A drive that is commanded in volts has its constant in N/V.
    if (const auto said = unit_said(node[row.name]);
        unit == "N/A" && said && said->same_quantity(*parse_unit(is_turning ? "N m/V" : "N/V"))) {
      unit = "N/V";
      for (auto& signal : model.signals)
        if (signal.name == "current" || signal.name == "feedforward") signal.unit = "V";
    }
    auto bounds = row.bounds;
    constexpr double smallest_rotor = 1e-12;  // [kg m2] a watch's wheel
    if (is_turning && bounds.lower > 0.0) bounds.lower = smallest_rotor;
    add_parameter(model, row.name, physics::counted_unit(model, unit), node[row.name], bounds);
  }
}

void read_controller(const Node& root, Model& model) {
  if (!root.has("controller")) return;
  const auto node = root["controller"];
  physics::AxisControllerSettings settings;
  const bool cascade = node.choice("kind", {"pid", "cascade"}) == "cascade";
  settings.kind =
      cascade ? physics::AxisControllerSettings::Kind::cascade : physics::AxisControllerSettings::Kind::pid;
  settings.rate = node.number("rate", "Hz", {1.0, 1e6});
  settings.kp = node.number("kp", "1");
  if (cascade) {
    settings.kv = node.number("kv", "1");
  } else {
    settings.ki = node.number("ki", "1", {}, 0.0);
    settings.kd = node.number("kd", "1", {}, 0.0);
  }
  if (node.has("velocity_filter_hz"))
    settings.velocity_filter_hz = node.number("velocity_filter_hz", "1", Range::positive());
  settings.limit = node.number("limit", "1", Range::not_negative(), 0.0);
  if (node.has("current"))
    model.records_applied = node.choice("current", {"command", "applied"}) == "applied";
  if (node.has("hold")) model.reference_goes_on = node.choice("hold", {"step", "smooth"}) == "smooth";
  model.controller = settings;
}

/// What a heater is commanded in, by what its gain is per: "W/%" -> "%", "W/V" -> "V", "W/duty" -> "duty", "W" -> "1"; "W"
/// where the gain is a pure number or says no unit.
std::string commanded_in(const Node& gain) {
  if (!gain.is_map() || !gain.has("unit")) return "W";
  auto text = gain.text("unit");
  const auto is_power = [](const std::string& unit) {
    const auto said = parse_unit(unit);
    return said && said->same_quantity(*parse_unit("W"));
  };
  const auto slash = text.find('/');
  if (slash == std::string::npos || !is_power(text.substr(0, slash))) return is_power(text) ? "1" : "W";
  text.erase(0, slash + 1);
  if (is_power(text)) return "W";
  if (text.size() > 2 && text.front() == '(' && text.find(')') == text.size() - 1)
    text = text.substr(1, text.size() - 2);
  return text;
}

/// A heater's column counts in what its gain is per.
void add_gain(Model& model, const std::string& name, const Node& node) {
  const Range bounds{0.0, 1e6};
  const auto gain = node.required("gain");
  const auto per = commanded_in(gain);
  const auto unit = per == "1" ? "W" : "W/" + per;
  model.signals.push_back({name, node.text("column"), per, false});
  if (parse_unit(unit)) {
    add_parameter(model, name + ".gain", unit, gain, bounds);
    return;
  }
  auto quantity = free_quantity(gain, bounds);  // per a unit of the user's own
  const auto said = gain.text("unit");
  const double factor = parse_unit(said.substr(0, said.find('/')))->factor;
  quantity.value *= factor;
  if (quantity.sigma) *quantity.sigma *= factor;
  model.parameters.push_back({name + ".gain", unit, quantity.value, quantity.sigma, bounds});
}

void read_thermal(const Node& root, Model& model) {
  for (const auto& node : root.required("nodes").children()) {
    const auto name = node.key();
    model.thermal.nodes.push_back(name);
    model.signals.push_back({name, node.text("column"), "degC", true});
    add_parameter(model, name + ".capacity", "J/K", node.required("capacity"), {1e-9, 1e12});
    add_parameter(model, name + ".loss", "W/K", node.required("loss"), {0.0, 1e9});
  }
  if (model.thermal.nodes.empty())
    root["nodes"].fault("names no node", "add one, with column, capacity and loss");
  const auto known = [&](const Node& at, const std::string& name) {
    if (std::find(model.thermal.nodes.begin(), model.thermal.nodes.end(), name) == model.thermal.nodes.end())
      at.fault("`" + name + "` is no node of this model", "name one of `nodes`");
  };
  for (const auto& node : root["heaters"].children()) {
    const auto name = node.key();
    model.thermal.heaters.push_back({name, node.text("node")});
    known(node["node"], model.thermal.heaters.back().node);
    add_gain(model, name, node);
  }
  for (const auto& node : root["couplings"].children()) {
    const auto pair = node.required("between").as_texts();
    if (pair.size() != 2) {
      node["between"].fault("names " + std::to_string(pair.size()) + " nodes", "name two");
      continue;
    }
    if (pair[0] == pair[1]) node["between"].fault("names `" + pair[0] + "` twice", "name two nodes");
    for (const auto& name : pair) known(node["between"], name);
    model.thermal.couplings.emplace_back(pair[0], pair[1]);
    add_parameter(model, pair[0] + "-" + pair[1] + ".conductance", "W/K", node.required("conductance"),
                  {0.0, 1e9});
  }
  const auto ambient = root.required("ambient");
  if (ambient.is_map())
    add_parameter(model, "ambient", "degC", ambient, {-100.0, 1000.0});
  else
    model.signals.push_back({"ambient", ambient.as_text(), "degC", false});
}

/// A number of the user's own expressions, in whatever unit he says.
void add_own(Model& model, std::string name, const Node& node) {
  auto unit = node.is_map() ? node.text("unit", "1") : "1";
  const auto quantity = parse_unit(unit) ? node.as_quantity(unit, {}) : free_quantity(node, {});
  model.parameters.push_back({std::move(name), std::move(unit), quantity.value, quantity.sigma, {}});
}

/// What the controller decides is an input that needs no column, whether the user lists it or not.
void add_decided_input(const Node& root, Model& model) {
  const auto& decided = model.equations.controlled_input;
  if (decided.empty() || root["inputs"].has(decided)) return;
  model.equations.inputs.push_back({decided, decided, false});
  model.signals.push_back({decided, decided, "", false});
}

/// The unit that the user's expressions count a column in, where he says so: the header's is converted to it.
std::string counted_in(const Node& node) {
  if (!node.has("unit")) return {};
  const auto unit = node.text("unit");
  if (!parse_unit(unit))
    node["unit"].fault("`" + unit + "` is no unit that is known", "write one like `mL/s`, or leave it out");
  return unit;
}

void read_equations(const Node& root, Model& model) {
  for (const auto& node : root["inputs"].children()) {
    physics::Equations::Input input{node.key(), node.key(), false};
    std::string column, unit;
    if (node.is_map()) {
      column = node.text("column");
      input.linear = node.choice("hold", {"linear", "step"}, "step") == "linear";
      unit = counted_in(node);
    } else {
      column = node.as_text();
    }
    model.equations.inputs.push_back(input);
    model.signals.push_back({input.signal, column, unit, false});
  }
  for (const auto& node : root["states"].children()) {
    model.equations.states.push_back({node.key(), node.text("derivative")});
    add_own(model, node.key() + ".initial", node.required("initial"));
  }
  for (const auto& node : root.required("outputs").children()) {
    physics::Equations::Output output{node.key(), node.text("expression"), {}};
    if (node.has("limits")) output.limits = node["limits"].as_range("");
    model.equations.outputs.push_back(output);
    model.signals.push_back({node.key(), node.text("column"), counted_in(node), true});
  }
  for (const auto& node : root["parameters"].children()) add_own(model, node.key(), node);
  if (root.has("controller")) {
    model.equations.controlled_input = root["controller"].text("output");
    model.equations.control_law = root["controller"].text("expression");
    add_decided_input(root, model);
  }
}

/// The place of a parameter in the file: parameters.mass, nodes.slide.loss, heaters.pad.gain, ambient, ...
YAML::Node place_of(YAML::Node root, const Model& model, const std::string& name) {
  const auto dot = name.rfind('.');
  if (dot == std::string::npos)
    return name == "ambient" && root["ambient"] ? root["ambient"] : root["parameters"][name];
  const auto owner = name.substr(0, dot), key = name.substr(dot + 1);
  if (model.plant == Plant::equations) return root["states"][owner][key];
  if (key == "gain") return root["heaters"][owner][key];
  if (key != "conductance") return root["nodes"][owner][key];
  for (auto coupling : root["couplings"]) {
    const auto pair = coupling["between"];
    if (pair[0].as<std::string>() + "-" + pair[1].as<std::string>() == owner) return coupling[key];
  }
  return {};
}

}  // namespace

physics::Model read(const config::Yaml& yaml) {
  const auto root = yaml.root();
  Model model;
  (void)root.integer("invar_model", 1, 1);
  const auto plant = root.choice("plant", {"axis", "thermal", "error_map", "droplet", "sensor", "equations"});
  (void)physics::plant_by_name(plant, model.plant);
  if (model.plant == Plant::axis) read_controller(root, model);
  read_columns(root, model);
  switch (model.plant) {
    case Plant::thermal:
      read_thermal(root, model);
      break;
    case Plant::equations:
      read_equations(root, model);
      check_own_expressions(root, model);
      break;
    default:
      read_parameters(root, model);
  }
  if (model.plant == Plant::error_map) {
    model.baseline.positions = root.required("baseline").required("positions").as_numbers("m");
    model.baseline.errors = root["baseline"].required("errors").as_numbers("m");
    if (model.baseline.positions.empty() || model.baseline.positions.size() != model.baseline.errors.size())
      root["baseline"].fault("positions and errors differ in number", "write one error a position");
    model.baseline.axis = root.text("axis", "");
    if (root["range"].has("temperature"))
      model.baseline.temperature = root["range"]["temperature"].as_range("degC");
  }
  for (const auto& node : root["noise"].children()) {
    const auto sigma = node.as_number("", Range::not_negative());
    const auto key = node.key();
    const auto at = std::find_if(model.signals.begin(), model.signals.end(), [&](const Signal& signal) {
      return signal.is_output && (signal.name == key || signal.column == key);
    });
    if (at == model.signals.end())
      node.fault("`" + key + "` is no output of this model", "name an output or its column");
    else
      model.noise[at->name] = sigma;
  }
  const auto terms = root["terms"].children();
  if (terms.size() > limits::model_terms) {
    root["terms"].fault("has " + std::to_string(terms.size()) + " terms",
                        "keep at most " + std::to_string(limits::model_terms));
    yaml.finish();
  }
  for (const auto& node : terms)
    if (auto term = read_term(node, model)) model.terms.push_back(*term);
  return model;
}

physics::Model load(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  auto model = read(yaml);
  yaml.finish();
  return model;
}

std::string patched(const config::Yaml& original, const physics::Model& changed) {
  YAML::Node root = YAML::Clone(original.root().raw());
  const Model before = read(original);
  for (const auto& parameter : changed.parameters) {
    const auto* old = before.find(parameter.name);
    if (old != nullptr && old->value == parameter.value) continue;
    place_of(root, changed, parameter.name) = quantity_yaml(parameter.value, parameter.unit, parameter.sigma);
  }
  root["terms"] = YAML::Node{YAML::NodeType::Sequence};
  for (const auto& term : changed.terms) root["terms"].push_back(term_yaml(term, changed));
  if (changed.reference_goes_on && !before.reference_goes_on)
    root["controller"]["hold"] = *changed.reference_goes_on ? "smooth" : "step";
  if (changed.records_applied && !before.records_applied) root["controller"]["current"] = "applied";
  if (const auto& covered = changed.baseline.temperature) {
    YAML::Node range;
    for (const double end : {covered->lower, covered->upper}) range.push_back(end);
    range.SetStyle(YAML::EmitterStyle::Flow);
    root["range"]["temperature"] = range;
  }
  YAML::Emitter out;
  out << root;
  return std::string{out.c_str()} + "\n";
}

}  // namespace invar::model
