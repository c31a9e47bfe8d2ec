#include "core/diagnosis/report/course.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"
#include "core/physics/static_plants.hpp"

namespace invar::diagnosis {

namespace {

using physics::EquationsMemory;
using Series = std::vector<double>;

/// A state as the best model has it, an input or the time; empty where it is not known.
Series variable_of(const Case& data, const Diagnosis& d, const std::string& name, std::size_t recording) {
  const auto& inputs = data.recordings[recording].inputs;
  const auto& states = data.model.equations.states;
  for (std::size_t i = 0; i < states.size(); ++i)
    if (states[i].name == name) {
      const auto shown = showing_states(d.best.model);
      physics::Outputs out;
      physics::prepare(shown, inputs)->run(shown, out);
      return out[i];
    }
  for (const auto& input : data.model.equations.inputs)
    if (input.symbol == name) return variable_values(data, recording, input.signal);
  for (const auto& output : data.outputs)
    if (physics::place_of_output(data.model.equations, output) == name)
      return variable_values(data, recording, output);
  return name == "t" ? inputs.time : Series{};
}

Course course_in_equations(const Case& data, const Diagnosis& d, const physics::Term& term) {
  const auto& kind = *physics::equations_kind(*term.info);
  const bool is_over = kind.memory == EquationsMemory::overflow;
  Course course{is_over ? term.on : physics::goes_over(term), {}, {}};
  if (kind.memory == EquationsMemory::delay || kind.memory == EquationsMemory::lag ||
      kind.memory == EquationsMemory::hidden_state)
    return course;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto values = variable_of(data, d, course.variable, r);
    if (values.empty()) return {};
    double size = 0.0;
    for (const double v : values) size = std::isfinite(v) ? std::max(size, std::abs(v)) : size;
    auto& power = course.power.emplace_back();
    const double limit = term.values[0], near = 1e-3 * size;  // what is held at a limit goes hardly beyond
    for (const double v : values) {
      double does = 1.0;
      if (kind.rate != nullptr) does = kind.rate(v, term.values.data());
      if (kind.memory == EquationsMemory::upper_limit || is_over) does = v >= limit - near ? 1.0 : 0.0;
      if (kind.memory == EquationsMemory::lower_limit) does = v <= limit + near ? 1.0 : 0.0;
      if (kind.memory == EquationsMemory::dead_zone) does = std::clamp(v, -limit, limit);
      power.push_back(does * does);
    }
    course.values.push_back(std::move(values));
  }
  return course;
}

Course course_of_heat(const Case& data, const physics::Term& term) {
  const auto& kind = *physics::thermal_kind(*term.info);
  Course course{std::string{term.info->depends_on.front()}, {}, {}};
  if (kind.memory != physics::ThermalMemory::none) return course;
  std::string heater;
  for (const auto& one : data.model.thermal.heaters)
    if (one.node == term.on && heater.empty()) heater = one.name;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& time = data.recordings[r].inputs.time;
    const auto recorded = [&](const std::string& name, double otherwise) {
      auto values = variable_values(data, r, name);
      if (values.size() != time.size()) values.assign(time.size(), otherwise);
      return values;
    };
    const auto air = recorded("ambient", data.model.value("ambient", 20.0));
    const auto temperature = recorded(term.on, air.front());
    const auto other = recorded(term.with, air.front()), speed = recorded("speed", 0.0);
    const auto current = recorded("motor_current", 0.0), watt = recorded(heater, 0.0);
    auto& power = course.power.emplace_back();
    for (std::size_t i = 0; i < time.size(); ++i) {
      const auto* p = term.values.data();
      double does = 0.0;
      if (kind.heat != nullptr)
        does = kind.heat({time[i], temperature[i], other[i], air[i], speed[i], current[i]}, p);
      if (kind.ambient != nullptr) does = kind.ambient(time[i], p);
      if (kind.heater != nullptr) does = watt[i] - kind.heater(watt[i], p);
      power.push_back(does * does);
    }
    course.values.push_back(course.variable == "time"            ? time
                            : course.variable == "speed"         ? speed
                            : course.variable == "motor_current" ? current
                            : course.variable == "power"         ? watt
                                                                 : temperature);
  }
  return course;
}

}  // namespace

Course course_of(const Case& data, const Diagnosis& d, const physics::Term& term) {
  return data.model.plant == physics::Plant::equations ? course_in_equations(data, d, term)
                                                       : course_of_heat(data, term);
}

}  // namespace invar::diagnosis
