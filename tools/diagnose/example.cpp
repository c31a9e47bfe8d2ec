#include "tools/diagnose/example.hpp"

#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;

constexpr const char* axis = R"(
columns: {time: t, reference: setpoint, position: encoder, current: current}   # signal: column of the recording
controller: {kind: pid, rate: 1000.0, kp: 4.0e3, ki: 2.0e4, kd: 60.0, velocity_filter_hz: 200.0, limit: 8.0}
# or {kind: cascade, rate: 1000.0, kp: 160.0, kv: 240.0, limit: 10.0}; without a controller `current` is an input
# pid: u = clamp(kp e + ki sum(e) / rate + kd d, +-limit), e = reference - position; the sum holds e[k], which is not added where u clamps;
#   kd acts on the error: d[k] = d[k-1] + a ((e[k] - e[k-1]) rate - d[k-1]), a = 1 - exp(-2 pi velocity_filter_hz / rate), 1 without a filter
# cascade: u = clamp(kv (kp e - v), +-limit), v as d but of the measured position. Sum and filter begin at 0, e[-1] = e[0]; no limit: no clamp
# current: `command`: the column holds the controller's output; `applied`: the current behind what acts on it before the motor
# hold: where not every cycle of the controller has its row, `step`: the reference is held from row to row, `smooth`: it goes on
parameters:
  mass: {value: 3.2, unit: kg, sigma: 0.06}
  motor_constant: {value: 20.0, unit: N/A, sigma: 0.2}
  viscous_damping: {value: 8.0, unit: N s/m, sigma: 2.0}
)";

constexpr const char* thermal = R"(
columns: {time: t}                            # also speed, motor_current
nodes:
  slide: {column: T_slide, capacity: {value: 850, unit: J/K, sigma: 40}, loss: {value: 9.0, unit: W/K, sigma: 0.7}}
  base: {column: T_base, capacity: {value: 4000, unit: J/K, sigma: 200}, loss: {value: 12.0, unit: W/K, sigma: 1.0}}
heaters:
  pad: {node: slide, column: P_pad, gain: {value: 1.0, unit: W/W, sigma: 0.02}}
couplings:
  - {between: [slide, base], conductance: {value: 3.0, unit: W/K, sigma: 0.5}}
ambient: T_amb                                # a column, or {value: 23.0, unit: degC, sigma: 0.5}
)";

constexpr const char* error_map = R"(
columns: {position: x, time: t, temperature: T, error: error}    # also direction, pressure, offset
baseline: {positions: [0.0, 0.1, 0.2, 0.3], errors: [0.0, 1.0e-6, -1.0e-6, 2.0e-6]}    # the last calibration, in m
parameters:
  reference_temperature: {value: 20.0, unit: degC, sigma: 0}
)";

constexpr const char* droplet = R"(
columns: {target_x: tx, target_y: ty, height: h, time: t, velocity_x: vx, velocity_y: vy, landed_x: lx, landed_y: ly}
parameters:                                   # also camera_scale; columns also pressure, on_time, image_x, image_y
  placement_error_x: {value: 0.0, unit: m, sigma: 1.0e-4}
  placement_error_y: {value: 0.0, unit: m, sigma: 1.0e-4}
  slope_x: {value: 0.0, unit: 1, sigma: 0.01}
  slope_y: {value: 0.0, unit: 1, sigma: 0.01}
  speed: {value: 2.0, unit: m/s, sigma: 0.2}
)";

constexpr const char* sensor = R"(
columns: {time: t, true_position: laser, encoder: encoder, velocity_sensor: tachometer}    # one of the last two is enough
parameters:
  resolution: {value: 1.0e-6, unit: m, sigma: 0}
  gain: {value: 1.0, unit: 1, sigma: 0.02}
)";

constexpr const char* equations = R"(
columns: {time: t}
inputs: {u: pump}                             # symbol: column; {column: pump, hold: linear} joins the rows by lines
states:
  h1: {derivative: "(k*u - a1*sqrt(h1))/A", initial: {value: 2.0, unit: cm, sigma: 0.5}}
  h2: {derivative: "(a1*sqrt(h1) - a2*sqrt(h2))/A", initial: {value: 4.0, unit: cm, sigma: 0.5}}
outputs: {level: {column: level, expression: "h2", limits: [0, 20]}}
parameters:
  A: {value: 15.0, unit: cm2, sigma: 0}       # sigma 0: known exactly
  k: {value: 3.0, unit: cm3/s, sigma: 0.3}
  a1: {value: 2.5, unit: 1}                   # no sigma: a start value, nothing is known beyond it
  a2: {value: 2.5, unit: 1}
# + - * / ^ and sin cos tan exp log sqrt abs sign min max tanh, pi, t (the time in s). A column with a unit is taken in SI, or in
# the unit as it stands where the numbers here are in it too. rpm is rad/s where they are angles. `unit` beside `column` says in
# which unit the expressions count it: {column: pump, unit: mL/s}.
# `controller: {output: u, expression: ...}` closes a loop.
)";

const char* body(Plant plant) {
  switch (plant) {
    case Plant::axis:
      return axis;
    case Plant::thermal:
      return thermal;
    case Plant::error_map:
      return error_map;
    case Plant::droplet:
      return droplet;
    case Plant::sensor:
      return sensor;
    case Plant::equations:
      return equations;
  }
  return "";
}

/// `#   sensor_lag (measurement): time_constant [s]`
std::string terms(Plant plant) {
  std::string text;
  for (const auto* info : physics::terms_of(plant)) {
    text += "#   " + std::string{info->name} + " (" + std::string{info->site} + "):";
    for (std::size_t i = 0; i < info->parameter_count(); ++i)
      text += (i == 0 ? " " : ", ") + std::string{info->parameters[i].name} +
              (info->parameters[i].unit == "*" ? std::string{}
                                               : " [" + std::string{info->parameters[i].unit} + "]");
    text += "\n";
  }
  return text;
}

}  // namespace

std::string example_model(Plant plant) {
  const char* place = plant == Plant::thermal     ? ", node: slide"
                      : plant == Plant::sensor    ? ", on: encoder"
                      : plant == Plant::equations ? ", on: h1"
                                                  : "";
  return "# What is believed of the machine, with its uncertainty (1 sigma). A recording has a header `name "
         "[unit]` a column\n"
         "# and one row a sample; an empty cell is a missing value.\n"
         "invar_model: 1\nplant: " +
         std::string{physics::name_of(plant)} + body(plant) +
         "# noise: {<output>: 0.01}                   # 1 sigma in the column's unit; left out, it is "
         "estimated\n"
         "terms: []                                    # physics that is modelled already, for example\n"
         "#   - {term: " +
         std::string{physics::terms_of(plant).front()->name} + place +
         ", <parameter>: {value: ..., unit: ...}}\n"
         "# What `invar diagnose` may find here, and what may stand above:\n" +
         terms(plant);
}

}  // namespace invar::diagnosis
