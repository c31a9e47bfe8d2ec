#include "core/physics/counted_units.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "core/physics/equations_columns.hpp"

namespace invar::physics {

namespace {

/// Each unit of the tables of axis and sensor that holds a length, and what stands in its place on a machine that turns.
constexpr std::array<std::pair<std::string_view, std::string_view>, 12> turned{{{"m", "rad"},
                                                                                {"m/s", "rad/s"},
                                                                                {"kg", "kg m2"},
                                                                                {"N", "N m"},
                                                                                {"N/s", "N m/s"},
                                                                                {"N/m", "N m/rad"},
                                                                                {"N s/m", "N m s/rad"},
                                                                                {"N s2/m2", "N m s2/rad2"},
                                                                                {"N/A", "N m/A"},
                                                                                {"N/V", "N m/V"},
                                                                                {"s/m", "s/rad"},
                                                                                {"N/A2", "N m/A2"}}};

}  // namespace

bool is_rotary(const Model& model) {
  if (model.plant != Plant::axis && model.plant != Plant::sensor) return false;
  const auto* signal = model.signal(model.plant == Plant::axis ? "position" : "true_position");
  return signal != nullptr && signal->unit == "rad";
}

std::string rotary_unit(std::string_view unit) {
  const auto* found =
      std::find_if(turned.begin(), turned.end(), [&](const auto& pair) { return pair.first == unit; });
  return std::string{found == turned.end() ? unit : found->second};
}

void count_in_angles(Model& model) {
  for (auto& signal : model.signals) signal.unit = rotary_unit(signal.unit);
}

std::string counted_unit(const Model& model, std::string_view unit) {
  return is_rotary(model) ? rotary_unit(unit) : std::string{unit};
}

std::string unit_of_parameter(const Model& model, const Term& term, std::size_t parameter) {
  const auto unit = term.info->parameters[parameter].unit;
  const auto& on = term.info->depends_on;
  const bool of_command =
      model.plant == Plant::thermal && unit == "W" && std::find(on.begin(), on.end(), "power") != on.end();
  return of_command ? heater_unit(model, term.on) : counted_unit(model, unit);
}

Range bounds_of_parameter(const Model& model, const Term& term, std::size_t parameter) {
  auto bounds = term.info->parameters[parameter].bounds;
  // The tables bound lengths by what fits on a straight axis of a metre or two: three turns of one that turns.
  constexpr double of_a_metre = 20.0;  // [rad]
  const auto unit = term.info->parameters[parameter].unit;
  if ((unit == "m" || unit == "m/s") && is_rotary(model)) {
    bounds.upper *= of_a_metre;
    if (bounds.lower < 0.0) bounds.lower *= of_a_metre;
  }
  // A rate against the motion has one sign; an instrument may count either way.
  if (model.plant == Plant::equations && term.info->parameters[parameter].role == Role::amplitude &&
      is_added(term) &&
      std::any_of(model.equations.outputs.begin(), model.equations.outputs.end(), [&](const auto& output) {
        return place_of_output(model.equations, output.name) == term.on;
      }))
    return {};
  return bounds;
}

std::string heater_unit(const Model& model, std::string_view node) {
  for (const auto& heater : model.thermal.heaters)
    if (heater.node == node)
      if (const auto* signal = model.signal(heater.name)) return signal->unit;
  return "W";
}

}  // namespace invar::physics
