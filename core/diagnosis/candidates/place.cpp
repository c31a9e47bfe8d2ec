#include "core/diagnosis/candidates/place.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::diagnosis {

std::string site_of(const Case& data, const physics::Term& term) {
  const std::string plant{physics::name_of(data.model.plant)};
  if (data.model.plant == physics::Plant::equations) {
    for (const auto& input : data.model.equations.inputs)
      if (input.symbol == term.on) return plant + ".input";
    for (const auto& output : data.model.equations.outputs)
      if (physics::place_of_output(data.model.equations, output.name) == term.on) return plant + ".output";
    return plant + "." + term.on;
  }
  return plant + "." + std::string{term.info->site};
}

std::vector<std::string> dependence(const Case& data, const physics::Term& term) {
  std::vector<std::string> names;
  for (const auto name : term.info->depends_on)
    if (!name.empty()) names.emplace_back(name == "temperature" ? physics::temperature_of(term) : name);
  if (!term.curve.over.empty()) {
    names.push_back(term.curve.over);
    if (term.curve.over.rfind("image", 0) == 0) names.emplace_back("image");
    if (term.curve.over.rfind("velocity_", 0) == 0) names.emplace_back("velocity");
    if (term.curve.memory != physics::Curve::Memory::none) names.emplace_back("history");
    if (is_multiplied(term)) names.push_back(term.with);
    if (term.with == "direction") names.emplace_back("velocity");  // whose sign it is
  }
  if (data.model.plant == physics::Plant::equations && term.curve.over.empty()) {
    if (term.info->has("share")) names.push_back(term.on);  // `with` is where that goes
    names.push_back(physics::goes_over(term));
  }
  return names;
}

std::vector<std::string> recorded_as(const Case& data, const std::string& variable) {
  const auto& equations = data.model.equations;
  if (data.model.plant == physics::Plant::equations && variable == "t") return {"time"};
  std::vector<std::string> signals;
  for (const auto& input : equations.inputs)
    if (input.symbol == variable) signals.push_back(input.signal);
  for (const auto& output : equations.outputs)
    if (output.expression == variable || physics::place_of_output(equations, output.name) == variable)
      signals.push_back(output.name);
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (name != variable && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const auto& name : signals) {
    add(name);
    if (const auto* signal = data.model.signal(name)) add(signal->column);
  }
  return names;
}

namespace {

/// A unit divided by another one; nothing is divided by what has none.
std::string per(const std::string& unit, const std::string& of, int power = 1) {
  if (power == 0 || of.empty() || of == "1") return unit;
  const bool joined = of.find_first_of("/ ^") != std::string::npos ||
                      std::isdigit(static_cast<unsigned char>(of.back())) != 0;
  if (of == "s" && power == 1 && unit.ends_with("/s")) return unit + "2";
  return unit + "/" + (joined ? "(" + of + ")" : of) + (power > 1 ? std::to_string(power) : "");
}

bool is_state(const Case& data, const std::string& place) {
  const auto& states = data.model.equations.states;
  return std::any_of(states.begin(), states.end(), [&](const auto& state) { return state.name == place; });
}

/// The unit of a place of the user's own equations: of the column that records it under whatever name, or of a state's start.
std::string unit_at(const Case& data, const std::string& place) {
  if (const auto unit = unit_of_variable(data, place); !unit.empty()) return unit;
  for (const auto& output : data.model.equations.outputs)
    if (output.expression == place)
      if (const auto unit = unit_of_variable(data, output.name); !unit.empty()) return unit;
  const auto* start = data.model.find(place + ".initial");
  return start != nullptr && start->unit != "1" ? start->unit : "";
}

/// The unit of an effect's number at a place of the user's own equations; an effect on a state is added to its rate.
std::string unit_of_added(const Case& data, const physics::Term& term, const std::string& of_place) {
  return per(is_state(data, term.on) ? per(of_place, "s") : of_place, unit_at(data, physics::goes_over(term)),
             term.info->power);
}

}  // namespace

std::string unit_of(const Case& data, const physics::Term& term, std::size_t parameter) {
  const auto unit = physics::unit_of_parameter(data.model, term, parameter);
  if (unit != "*") return unit;
  const auto is = [&](std::string_view name) { return parameter == term.info->index_of(name); };
  if (is("delay") || is("time_constant") || (is("period") && term.with == "t")) return "s";
  const auto unit_or_one = [](std::string text) { return text.empty() ? std::string{"1"} : text; };
  if (is("period")) return unit_or_one(unit_of_variable(data, physics::goes_over(term)));
  if (is("coefficient") && term.info->lateness == physics::Lateness::store)
    return is_state(data, term.on) ? "1/s" : "1";  // of a difference of two of one unit
  const std::string known = unit_at(data, term.on);
  if (known.empty() && data.model.signal(term.on) == nullptr)
    return "1";  // of a state nobody measures: the user's own
  const std::string of_place = unit_or_one(known);
  return term.info->lateness == physics::Lateness::none && term.info->cut == physics::Cut::nothing
             ? unit_of_added(data, term, of_place)
             : of_place;
}

std::string unit_of_variable(const Case& data, const std::string& variable) {
  if (variable == "time") return "s";
  if (variable == "velocity") return physics::counted_unit(data.model, "m/s");
  if (data.model.plant == physics::Plant::thermal) {
    if (variable == "temperature" || variable == "ambient") return "degC";
    if (variable == "power") return "W";
  }
  const auto* signal = data.model.signal(variable);
  return signal != nullptr ? signal->unit : "";
}

std::string name_beside(const Case& data, const physics::Term& term, const physics::Term& other) {
  const std::string name{term.info->name};
  return term.info == other.info ? name + " (" + place_of(data, term) + ")" : name;
}

std::string readable(std::string_view name) {
  std::string text{name};
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

std::string place_of(const Case& data, const physics::Term& term) {
  struct Words {
    const char* site;
    const char* words;
  };
  static constexpr std::array known{Words{"axis.force", "force on the carriage"},
                                    Words{"axis.actuator", "amplifier and motor"},
                                    Words{"axis.measurement", "position measurement"},
                                    Words{"axis.structure", "structure of the machine"},
                                    Words{"axis.disturbance", "disturbance from outside"},
                                    Words{"thermal.loss", "heat loss"},
                                    Words{"thermal.storage", "heat storage"},
                                    Words{"thermal.measurement", "temperature sensor"},
                                    Words{"thermal.exchange", "heat exchange"},
                                    Words{"thermal.source", "heat source"},
                                    Words{"error_map.kinematic", "guideway and scale"},
                                    Words{"error_map.thermal", "thermal growth"},
                                    Words{"error_map.measurement", "instrument that measured the error"},
                                    Words{"droplet.flight", "flight of the droplet"},
                                    Words{"droplet.valve", "valve"},
                                    Words{"droplet.camera", "camera"},
                                    Words{"sensor.measurement", "instrument"}};
  const auto site = site_of(data, term);
  if (data.model.plant == physics::Plant::axis && term.with == "command")
    return "current between controller and motor";
  if (data.model.plant == physics::Plant::equations) {
    const auto with = term.with.empty() || term.with == term.on ? "" : ", with " + term.with;
    for (const auto& input : data.model.equations.inputs)
      if (input.symbol == term.on) return "input " + term.on;
    for (const auto& output : data.model.equations.outputs)
      if (physics::place_of_output(data.model.equations, output.name) == term.on)
        return "output " + output.name + with;
    if (physics::is_felt_by_others_alone(term)) return "state " + term.on + " as the others feel it";
    return "state " + term.on + with;
  }
  std::string text = site;
  for (const auto& one : known)
    if (site == one.site) text = one.words;
  if (!term.on.empty()) text += (data.model.plant == physics::Plant::error_map ? " with " : " of ") + term.on;
  if (!term.with.empty() && data.model.plant == physics::Plant::axis)
    return term.with == "direction"      ? "dry friction of the carriage"
           : term.with == "acceleration" ? "mass of the carriage"
                                         : "damping of the carriage";
  if (!term.with.empty() && !is_multiplied(term)) text += " and " + term.with;
  return text;
}

bool is_multiplied(const physics::Term& term) {
  if (term.curve.knots.empty() || term.with.empty() || term.with == "command") return false;  // added to that
  if (term.info->plant == physics::Plant::equations) return true;
  if (term.info->plant == physics::Plant::error_map && physics::is_temperature(term.with)) return true;
  const auto known = physics::multipliers_of(*term.info);
  return std::find(known.begin(), known.end(), term.with) != known.end();
}

namespace {

/// The output that a place names: `level`, `output.level`.
std::string output_at(const Case& data, const std::string& place) {
  for (const auto& output : data.model.equations.outputs)
    if (physics::place_of_output(data.model.equations, output.name) == place) return output.name;
  return place;
}

}  // namespace

std::string unit_of_curve(const Case& data, const physics::Term& term) {
  using physics::Plant;
  const auto counted = [&](const char* unit) { return physics::counted_unit(data.model, unit); };
  switch (data.model.plant) {
    case Plant::axis:
      if (term.info->site == "force")
        return counted(term.with == "velocity"                                   ? "N s/m"
                       : term.with == "acceleration"                             ? "kg"
                       : term.curve.memory == physics::Curve::Memory::relaxation ? "N/m"
                                                                                 : "N");
      if (term.with == "command") return unit_of_variable(data, "current");
      return term.info->site == "measurement" ? counted("m") : "1";
    case Plant::thermal:
      if (term.with == "power") return "1";
      return term.info->site == "loss" || term.info->site == "exchange" ? "W/K"
             : term.info->site == "storage"                             ? "J/K"
                                                                        : "W";
    case Plant::error_map:
      if (physics::is_temperature(term.with)) return "m/K";
      return term.with == "position" || (term.with.empty() && term.info->site != "kinematic") ? "1" : "m";
    case Plant::droplet:
      return term.with.empty() ? "m" : "1";
    default: {
      if (data.model.plant == Plant::equations)  // a state's rate counts in the user's own unit
        return term.info->site == "output" ? unit_of_variable(data, output_at(data, term.on)) : "";
      const auto* signal = data.model.signal(term.on);
      if (signal == nullptr || term.with.empty()) return signal != nullptr ? signal->unit : "";
      const bool is_speed = signal->unit == "m/s", by_speed = term.with == "velocity";
      return is_speed == by_speed ? "1" : by_speed ? "s" : "1/s";
    }
  }
}

}  // namespace invar::diagnosis
