#include "core/model/term_file.hpp"

#include <algorithm>
#include <cstdio>

#include "core/physics/counted_units.hpp"
#include "core/physics/curve_memory.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"
#include "core/physics/static_plants.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::model {

using config::Node;
using physics::Model;
using physics::Plant;
using physics::Term;

config::Quantity free_quantity(const Node& node, Range bounds) {
  if (!node.is_map()) return {node.as_number("", bounds), {}};
  (void)node.text("unit", "");
  config::Quantity quantity{node.required("value").as_number("", bounds), {}};
  if (node.has("sigma")) quantity.sigma = node["sigma"].as_number("", Range::not_negative());
  return quantity;
}

namespace {

/// In an error map a term that goes with a temperature may name a further one.
bool check_temperature(const Node& node, const Model& model, const Term& term) {
  if (term.on.empty()) return true;
  const std::string name{term.info->name};
  if (term.info->needs != "temperature" || !term.curve.knots.empty()) {
    node["on"].fault("`" + name + "` acts at one place alone", "leave `on` out");
  } else if (!physics::is_temperature(term.on) || model.signal(term.on) == nullptr) {
    node["on"].fault("`" + term.on + "` is no temperature of this model",
                     "name one of `columns`: temperature, or temperature_<place>");
  } else {
    return true;
  }
  node.accept_all();
  return false;
}

/// In the user's own equations a term says where it acts; what changes a rate acts on a state.
bool check_place(const Node& node, const Model& model, const Term& term) {
  std::vector<std::string> places;
  for (const auto& state : model.equations.states) places.push_back(state.name);
  const bool on_state = std::find(places.begin(), places.end(), term.on) != places.end();
  for (const auto& input : model.equations.inputs) places.push_back(input.symbol);
  std::vector<std::string> outputs;
  for (const auto& output : model.equations.outputs)
    outputs.push_back(physics::place_of_output(model.equations, output.name));
  const bool on_output = std::find(outputs.begin(), outputs.end(), term.on) != outputs.end();
  places.insert(places.end(), outputs.begin(), outputs.end());
  const std::string name{term.info->name};
  if (std::find(places.begin(), places.end(), term.on) == places.end()) {
    const auto meant = config::nearest(term.on, places);
    node.fault("`" + name + "` acts on `" + term.on + "`, which is no state, input or output",
               meant.empty() ? "name one of them under `on`" : "did you mean `" + meant + "`?");
    node.accept_all();
    return false;
  }
  const auto* kind = physics::equations_kind(*term.info);
  const bool is_rate =
      kind != nullptr && (kind->rate != nullptr || kind->memory == physics::EquationsMemory::dry_friction ||
                          !term.curve.knots.empty());
  const bool misreads = !term.curve.knots.empty() && term.info->site == "output";
  const bool is_reading = on_output && term.curve.knots.empty();
  if (is_rate && !is_reading && !(misreads ? on_output : on_state)) {
    if (misreads)
      node.fault("a course of site `output` acts on `" + term.on + "`, which is none",
                 "name an output under `on`");
    else
      node.fault(
          "`" + name + "` changes a rate or a reading, and `" + term.on + "` is no state and no output",
          "name one of them under `on`");
    node.accept_all();
    return false;
  }
  if (misreads && !term.with.empty()) {
    node.fault("an error of an output's reading goes over one variable alone", "leave `with` out");
    node.accept_all();
    return false;
  }
  std::vector<std::string> symbols{"t"};
  for (const auto& state : model.equations.states) symbols.push_back(state.name);
  for (const auto& input : model.equations.inputs) symbols.push_back(input.symbol);
  const auto is_known = [&](const char* key, const std::string& symbol) {
    if (std::find(symbols.begin(), symbols.end(), symbol) != symbols.end()) return true;
    node[key].fault("`" + symbol + "` is no state, no input and not t", "name one of them");
    node.accept_all();
    return false;
  };
  if (misreads) return term.curve.over == term.on || is_known("over", term.curve.over);
  if (is_rate && is_reading) {
    if (name == "constant" || !term.with.empty()) return name == "constant" || is_known("with", term.with);
    node.fault("`" + name + "` at an output goes with another variable, and none is named",
               "name a state, an input or t under `with`");
    node.accept_all();
    return false;
  }
  if (physics::is_felt_otherwise(term) && !term.with.empty() && (term.with != "others" || !on_state)) {
    node["with"].fault("`" + name + "` is felt by all rates, or of a state by the `others` alone",
                       "write `others`, or leave it out");
    node.accept_all();
    return false;
  }
  if (term.curve.over.empty()) return true;
  return is_known("over", term.curve.over) && (term.with.empty() || is_known("with", term.with));
}

/// Of a curve whose knots are thresholds or time constants.
void read_memory(const Node& node, const Model& model, Term& term) {
  const auto kind = node.text("memory");
  using Memory = physics::Curve::Memory;
  term.curve.memory = Memory::none;
  for (const auto memory : {Memory::stop, Memory::relaxation})
    if (kind == physics::name_of(memory)) term.curve.memory = memory;
  if (term.curve.memory == Memory::none)
    node["memory"].fault("`" + kind + "` is no memory of a curve", "write `stop` or `relaxation`");
  const bool is_place = model.plant == Plant::axis
                            ? term.info->site == "force" && term.curve.over == "position"
                            : model.plant == Plant::equations && term.info->site == "state";
  if (!is_place)
    node["memory"].fault("a curve with memory is a force over `position`, or a rate over a state",
                         "leave `memory` out");
  if (!(term.curve.knots.front() > 0.0) || term.curve.knots.size() > physics::CurveMemory::most)
    node["knots"].fault("the knots of a curve with memory are thresholds or time constants",
                        "write at most " + std::to_string(physics::CurveMemory::most) + ", each above 0");
}

/// Of equations and of a coupling between nodes `with` is a place.
void check_multiplier(const Node& node, const Model& model, const Term& term) {
  const bool is_curve = !term.curve.knots.empty();
  if (term.with.empty() || term.info == nullptr || model.plant == Plant::equations) return;
  const auto& nodes = model.thermal.nodes;
  if (std::find(nodes.begin(), nodes.end(), term.with) != nodes.end()) return;
  const auto known = is_curve ? physics::multipliers_of(*term.info) : std::vector<std::string_view>{};
  if (std::find(known.begin(), known.end(), term.with) != known.end()) return;
  if (is_curve && model.plant == Plant::error_map && physics::is_temperature(term.with) &&
      model.signal(term.with) != nullptr)
    return;
  std::string list;
  for (std::size_t i = 0; i < known.size(); ++i)
    list += (i == 0 ? "`" : i + 1 < known.size() ? ", `" : " or `") + std::string{known[i]} + "`";
  node["with"].fault("nothing of site `" + std::string{term.info->site} + "` goes with `" + term.with + "`",
                     list.empty() ? "leave `with` out" : "a curve there goes with " + list + ", or alone");
}

}  // namespace

std::optional<Term> read_term(const Node& node, const Model& model) {
  const auto name = node.text("term");
  Term term;
  if (name == "unmodelled") {
    term.info = physics::unmodelled(model.plant, node.text("site", ""));
    term.curve.over = node.text("over");
    term.curve.knots = node.required("knots").as_numbers("");
    term.curve.values = node.required("values").as_numbers("");
    if (term.curve.knots.empty() || term.curve.knots.size() != term.curve.values.size() ||
        !std::is_sorted(term.curve.knots.begin(), term.curve.knots.end()))
      node["knots"].fault("knots must ascend and be as many as values", "write one value a knot");
    else if (node.has("memory")) {
      read_memory(node, model, term);
    } else if (node.has("period")) {
      term.curve.period = node["period"].as_number("", {1e-300, 1e300});
      if (!(term.curve.knots.back() - term.curve.knots.front() < term.curve.period))
        node["period"].fault("the knots reach over more than one period", "keep them within it");
    }
  } else {
    term.info = physics::find_term(model.plant, name);
  }
  term.on = node.text("on", node.text("node", ""));
  term.with = node.text("with", "");
  check_multiplier(node, model, term);
  if (node.has("between")) {
    const auto pair = node["between"].as_texts();
    if (pair.size() == 2) term.on = pair[0], term.with = pair[1];
  }
  if (term.on.empty() && !model.thermal.nodes.empty()) term.on = model.thermal.nodes.front();
  if (term.with.empty() && model.thermal.nodes.size() > 1)
    term.with = model.thermal.nodes[term.on == model.thermal.nodes[0] ? 1 : 0];
  if (term.on.empty() && model.plant == Plant::sensor) {
    const bool of_velocity = name == "gain_droop" && model.signal("velocity_sensor") != nullptr;
    term.on = of_velocity || model.signal("encoder") == nullptr ? "velocity_sensor" : "encoder";
  }
  if (term.info == nullptr) {
    std::vector<std::string> known;
    for (const auto* info : physics::terms_of(model.plant)) known.emplace_back(info->name);
    const auto meant = config::nearest(name, known);
    std::string list;
    for (const auto& one : known) list += (list.empty() ? "" : ", ") + one;
    node["term"].fault("`" + name + "` is no term of plant " + std::string{physics::name_of(model.plant)},
                       meant.empty() ? "it has: " + list : "did you mean `" + meant + "`?");
    node.accept_all();
    return std::nullopt;
  }
  if (model.plant == Plant::equations && !check_place(node, model, term)) return std::nullopt;
  if (model.plant == Plant::error_map && !check_temperature(node, model, term)) return std::nullopt;
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
    const auto& parameter = term.info->parameters[i];
    const std::string key{parameter.name};
    if (node.has(key)) {
      // "*": in whatever unit the place has on which the term acts; then only a number is checked. A time is one in any.
      const bool is_time = (key == "delay" || key == "time_constant") && node[key].is_map() &&
                           node[key].text("unit", "*") != "*";
      const auto quantity =
          parameter.unit == "*" && !is_time
              ? free_quantity(node[key], parameter.bounds)
              : node[key].as_quantity(is_time ? "s" : physics::unit_of_parameter(model, term, i),
                                      physics::bounds_of_parameter(model, term, i));
      term.values[i] = quantity.value;
      term.sigmas[i] = quantity.sigma;
      term.given[i] = true;
    } else if (const auto* shared = model.find(key)) {
      term.values[i] = shared->value;
    } else {
      term.values[i] = parameter.role == physics::Role::amplitude ? 0.0 : parameter.starts[0];
    }
  }
  return term;
}

YAML::Node quantity_yaml(double value, const std::string& unit, std::optional<double> sigma) {
  const auto text = [](double x) {
    char buffer[40];
    std::snprintf(buffer, sizeof buffer, "%.9g", x);
    return std::string{buffer};
  };
  YAML::Node node;
  node["value"] = text(value);
  node["unit"] = unit;
  if (sigma) node["sigma"] = text(*sigma);
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

YAML::Node term_yaml(const Term& term, const Model& model) {
  YAML::Node node;
  node["term"] = std::string{term.info->name};
  if (model.plant != Plant::axis && !term.on.empty()) node["on"] = term.on;
  if (!term.with.empty()) node["with"] = term.with;
  if (!term.curve.knots.empty()) {
    node["site"] = std::string{term.info->site};
    node["over"] = term.curve.over;
    for (double knot : term.curve.knots) node["knots"].push_back(knot);
    for (double value : term.curve.values) node["values"].push_back(value);
    node["knots"].SetStyle(YAML::EmitterStyle::Flow);
    node["values"].SetStyle(YAML::EmitterStyle::Flow);
    if (term.curve.period > 0.0) node["period"] = term.curve.period;
    if (term.curve.memory != physics::Curve::Memory::none)
      node["memory"] = std::string{physics::name_of(term.curve.memory)};
    return node;
  }
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
    const auto& parameter = term.info->parameters[i];
    if (!term.given[i] && model.find(parameter.name) != nullptr) continue;  // shared with the nominal model
    node[std::string{parameter.name}] =
        quantity_yaml(term.values[i], physics::unit_of_parameter(model, term, i), term.sigmas[i]);
  }
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

}  // namespace invar::model
