// Terms by name, through a model file, against what the contract's text says of them, written down anew.
#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <numbers>

#include "core/physics/approach.hpp"
#include "core/physics/droplet_hooks.hpp"
#include "core/physics/simulation.hpp"
#include "tests/support/model_of.hpp"

namespace invar::physics {
namespace {

using Columns = std::map<std::string, std::vector<double>, std::less<>>;

std::vector<double> simulated(const std::string& text, const std::vector<double>& time,
                              const Columns& signals, std::size_t output = 0) {
  const auto model = test::model_of("invar_model: 1\n" + text);
  Record record;
  record.time = time;
  record.signals = signals;
  Outputs outputs;
  prepare(model, record)->run(model, outputs);
  return outputs.at(output);
}

// --- droplet: one drop

constexpr double height = 0.012, vx = 0.3, vy = -0.1, ix = 400.0, iy = -250.0, scale = 1e-5, when = 200.0;

struct Spot {
  double x = 0.0, y = 0.0;
};

Spot landed(const std::string& terms, double pressure = 9e4) {
  const std::string text =
      "plant: droplet\n"
      "columns: {time: t, target_x: a, target_y: b, height: h, velocity_x: u, velocity_y: v, pressure: p, "
      "image_x: i, "
      "image_y: j, landed_x: x, landed_y: y}\n"
      "parameters: {placement_error_x: {value: 0, unit: m}, placement_error_y: {value: 0, unit: m}, "
      "slope_x: {value: 0, unit: 1}, slope_y: {value: 0, unit: 1}, speed: {value: 2, unit: m/s}, "
      "camera_scale: {value: 1e-5, unit: m/px}}\nterms: [" +
      terms + "]\n";
  const Columns signals{{"target_x", {0.0}},  {"target_y", {0.0}},  {"height", {height}},
                        {"velocity_x", {vx}}, {"velocity_y", {vy}}, {"pressure", {pressure}},
                        {"image_x", {ix}},    {"image_y", {iy}}};
  return {simulated(text, {when}, signals, 0)[0], simulated(text, {when}, signals, 1)[0]};
}

void expect_spot(const Spot& spot, double x, double y) {
  EXPECT_NEAR(spot.x, x, 1e-6 * std::abs(x) + 1e-15);
  EXPECT_NEAR(spot.y, y, 1e-6 * std::abs(y) + 1e-15);
}

const std::string carry = "{term: stage_velocity_carry, speed: {value: 4, unit: m/s}}";

TEST(Droplet, LandsWhereTheContractSays) {
  const double flight = height / 4.0;
  expect_spot(landed(carry), vx * flight, vy * flight);
  expect_spot(landed("{term: valve_delay, delay: {value: 300, unit: us}}"), 3e-4 * vx, 3e-4 * vy);
  const double half = 0.5 * (height / 2.0) * (height / 2.0);
  expect_spot(landed("{term: crosswind, acceleration_x: {value: 8, unit: m/s2}, acceleration_y: {value: -3, "
                     "unit: m/s2}}"),
              8.0 * half, -3.0 * half);
  // Speed falls with time, and goes with a power of pressure; the flight lasts the longer.
  const double slow = std::exp(1e-3 * when);
  expect_spot(landed(carry + ", {term: speed_decay, rate: {value: 1e-3, unit: 1/s}}"), vx * flight * slow,
              vy * flight * slow);
  const double less = std::sqrt(1e5 / 9e4);
  expect_spot(landed(carry + ", {term: pressure_dependence, exponent: {value: 0.5, unit: 1}, "
                             "reference_pressure: {value: 1e5, unit: Pa}}"),
              vx * flight * less, vy * flight * less);
}

TEST(Droplet, ACameraMovesTheSpotByItsScale) {
  const double stretch = 2e-8 * (ix * ix + iy * iy);
  expect_spot(landed("{term: lens_distortion, k1: {value: 2e-8, unit: 1/px2}}"), scale * stretch * ix,
              scale * stretch * iy);
  expect_spot(landed("{term: camera_rotation, angle: {value: 4, unit: mrad}}"), -scale * 4e-3 * iy,
              scale * 4e-3 * ix);
}

// Small steps of Newton's law in still air: Stokes' drag times 1 + 0.15 Re^0.687 on a sphere of water.
TEST(Droplet, AirBrakesInAllDirectionsAndGravityGoesOn) {
  constexpr double diameter = 8e-5, dt = 1e-7, rho = 1.19, eta = 1.82e-5;
  const double mass = 998.0 * std::numbers::pi / 6.0 * std::pow(diameter, 3);
  double x = 0.0, y = 0.0, z = 0.0, u = vx, v = vy, w = 4.0;
  while (z < height) {
    const double speed = std::hypot(u, v, w), re = rho * speed * diameter / eta;
    const double drag = 3.0 * std::numbers::pi * eta * diameter * (1.0 + 0.15 * std::pow(re, 0.687)) / mass;
    u -= dt * drag * u, v -= dt * drag * v, w += dt * (9.81 - drag * w);
    x += dt * u, y += dt * v, z += dt * w;
  }
  const auto spot = landed(carry + ", {term: air_drag, diameter: {value: 80, unit: um}}");
  EXPECT_NEAR(spot.x, x, 1e-3 * x);
  EXPECT_NEAR(spot.y, y, -1e-3 * y);
  EXPECT_GT(std::abs(spot.x - vx * height / 4.0), 4e-6);  // without air it lands elsewhere
}

TEST(Droplet, AMistDriftsWithThePushWhileItSinks) {
  // Small steps of Euler's rule: 20 um of water leave the jet's way after 2 mm and sink at 12 mm/s.
  double x = 0.0, z = 0.0, u = 0.0, w = 3.0;
  constexpr double h = 2e-6, push = 0.2, diameter = 2e-5;
  while (z < 0.01) {
    const double reynolds = 1.19 * std::hypot(u, w) * diameter / 1.82e-5;
    const double rate =
        18.0 * 1.82e-5 / (998.0 * diameter * diameter) * (1.0 + 0.15 * std::pow(reynolds, 0.687));
    x += h * u, z += h * w;
    u += h * (push - rate * u), w += h * (9.81 - rate * w);
  }
  Droplet mist;
  mist.height = 0.01, mist.speed = 3.0, mist.diameter = diameter, mist.pull_x = push;
  EXPECT_NEAR(landing(mist, 0.0, 0.0).x, x, 5e-3 * x);
}

// --- error map: one point of a travel from 0 to 0.4 m

double map_error(const std::string& term, const std::string& signal = "", double value = 0.0,
                 double position = 0.3) {
  const std::string column = signal.empty() ? "" : ", " + signal + ": q";
  const std::string text = "plant: error_map\ncolumns: {time: t, position: x, error: e" + column +
                           "}\nbaseline: {positions: [0, 0.4], errors: [0, 0]}\n"
                           "parameters: {reference_temperature: {value: 20, unit: degC}}\nterms: [" +
                           term + "]\n";
  Columns signals{{"position", {0.0, position, 0.4}}};
  if (!signal.empty()) signals[signal] = {value, value, value};
  return simulated(text, {0.0, 1.0, 2.0}, signals)[1];
}

TEST(ErrorMap, DirectionsFollowFromThePositions) {
  // Up, jitter, the end read twice, down, stood on three times, up again.
  EXPECT_THAT(directions_of_approach({0.0, 0.1, 0.09999, 0.2, 0.2, 0.1, 0.0, 0.0, 0.0, 0.1}),
              ::testing::ElementsAre(0, 1, 1, 1, -1, -1, -1, -1, -1, 1));
  EXPECT_THAT(directions_of_approach({}), ::testing::IsEmpty());
}

TEST(ErrorMap, IsWhatTheContractSays) {
  EXPECT_NEAR(map_error("{term: periodic_error, pitch: {value: 20, unit: mm}, amplitude: {value: 300, unit: "
                        "nm}, phase: {value: 0.7, unit: rad}}",
                        "", 0.0, 0.123),
              3e-7 * std::sin(2.0 * std::numbers::pi * 0.123 / 0.02 + 0.7), 1e-15);
  const std::string play = "{term: backlash, width: {value: 2, unit: um}}";
  EXPECT_NEAR(map_error(play, "direction", 1.0) - map_error(play, "direction", -1.0), 2e-6, 1e-15);
  const std::string tilt =
      "{term: abbe_offset, angle: {value: 5, unit: urad}, angle_change: {value: 2, unit: urad}}";
  EXPECT_NEAR(map_error(tilt, "offset", 0.03, 0.2), 0.03 * 5e-6, 1e-15);  // at the middle
  EXPECT_NEAR(map_error(tilt, "offset", 0.03, 0.3), 0.03 * 5.5e-6, 1e-15);
  EXPECT_NEAR(
      map_error("{term: thermal_expansion, coefficient: {value: 11, unit: ppm/K}}", "temperature", 23.0),
      11e-6 * 3.0 * 0.3, 1e-15);
  // The laser reads longer at higher pressure, and shorter at an angle.
  EXPECT_NEAR(map_error("{term: refractive_index, coefficient: {value: 2.7e-7, unit: 1/hPa}, "
                        "reference_pressure: {value: 1000, unit: hPa}}",
                        "pressure", 1013.0),
              2.7e-7 * 13.0 * 0.3, 1e-15);
  EXPECT_NEAR(map_error("{term: cosine_error, angle: {value: 1, unit: mrad}}"), 0.3 * (std::cos(1e-3) - 1.0),
              1e-12);
  // Sag is deepest at the middle and nothing at the ends.
  const std::string sag = "{term: sag, depth: {value: 500, unit: nm}}";
  EXPECT_NEAR(std::abs(map_error(sag, "", 0.0, 0.2)), 5e-7, 1e-15);
  EXPECT_NEAR(map_error(sag, "", 0.0, 0.0), 0.0, 1e-15);
}

// --- axis: how it sets off from rest under a current of 1 A, force over mass

double force(const std::string& term, double current = 1.0) {
  constexpr double mass = 2.0, step = 1e-4;
  const std::string text =
      "plant: axis\ncolumns: {time: t, position: x, current: u}\n"
      "parameters: {mass: {value: 2, unit: kg}, motor_constant: {value: 10, unit: N/A}, viscous_damping: "
      "{value: 0, unit: N s/m}}\n"
      "terms: [" +
      term + "]\n";
  std::vector<double> time;
  for (int i = 0; i <= 20; ++i) time.push_back(step * i);
  const auto x = simulated(text, time, {{"current", std::vector<double>(time.size(), current)}});
  const double t = time.back();
  return mass * 2.0 * x.back() / (t * t);
}

TEST(Axis, ForcesActOnTheCarriageAsTheContractSays) {
  constexpr double motor = 10.0;
  EXPECT_NEAR(force(""), motor, 1e-6);
  EXPECT_NEAR(force("{term: constant_force, force: {value: 3, unit: N}}"), motor + 3.0, 1e-6);
  EXPECT_NEAR(
      force("{term: position_stiffness, stiffness: {value: 500, unit: N/m}, center: {value: 4, unit: mm}}"),
      motor + 500.0 * 0.004, 0.01);
  EXPECT_NEAR(force("{term: force_ripple, pitch: {value: 0.5, unit: m}, amplitude: {value: 2, unit: N}, "
                    "phase: {value: 0.7, unit: rad}}"),
              motor + 2.0 * std::sin(0.7), 0.01);
  EXPECT_NEAR(force("{term: motor_constant_ripple, pitch: {value: 0.5, unit: m}, amplitude: {value: 0.1, "
                    "unit: 1}, phase: {value: 0.7, unit: rad}}"),
              motor * (1.0 + 0.1 * std::sin(0.7)), 0.01);
  EXPECT_NEAR(force("{term: magnetic_saturation, coefficient: {value: 0.03, unit: 1/A2}}", -2.0),
              -2.0 * motor * (1.0 - 0.03 * 4.0), 1e-6);
  EXPECT_NEAR(force("{term: dead_zone, width: {value: 0.2, unit: A}}"), motor * 0.8, 1e-6);
  EXPECT_NEAR(force("{term: dead_zone, width: {value: 0.2, unit: A}}", 0.15), 0.0, 1e-6);
  EXPECT_NEAR(force("{term: additive_disturbance, amplitude: {value: 0.3, unit: A}, frequency: {value: 0.1, "
                    "unit: Hz}, phase: {value: 0.7, unit: rad}}"),
              motor * (1.0 + 0.3 * std::sin(0.7)), 0.01);
  EXPECT_NEAR(force("{term: periodic_disturbance, amplitude: {value: 3, unit: N}, frequency: {value: 0.1, "
                    "unit: Hz}, phase: {value: 0.7, unit: rad}}"),
              motor + 3.0 * std::sin(0.7), 0.01);
  EXPECT_NEAR(force("{term: coulomb_friction, level: {value: 4, unit: N}}"), motor - 4.0, 0.5);
}

// --- equations: a term on the output, on the input and on the rate

double last(const std::string& term, double input = 0.5) {
  const std::string text =
      "plant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: \"u\", initial: {value: 0, unit: m, sigma: 0}}}\n"
      "outputs: {y: {column: y, expression: \"x\"}}\nparameters: {}\nterms: [" +
      term + "]\n";
  std::vector<double> time;
  for (int i = 0; i <= 400; ++i) time.push_back(0.005 * i);
  return simulated(text, time, {{"u", std::vector<double>(time.size(), input)}}).back();  // after 2 s
}

/// x' = a (u - x) where u is held: each change arrives `delay` late, between two rows, and x goes there as exp(-a t).
TEST(Equations, WhatIsHeldChangesLateBetweenTheRows) {
  constexpr double a = 3.0, delay = 0.13;
  const std::string text =
      "plant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: \"3*(u - x)\", initial: {value: 0, unit: m, sigma: 0}}}\n"
      "outputs: {y: {column: y, expression: \"x\"}}\nparameters: {}\n"
      "terms: [{term: delay, on: u, delay: {value: 0.13, unit: s}}]\n";
  std::vector<double> time, u;
  for (int i = 0; i < 40; ++i)
    time.push_back(0.4 * i + (i % 3 == 0 ? 0.05 : 0.0)), u.push_back(i % 5 < 2 ? 1.0 : -0.5);
  const auto y = simulated(text, time, {{"u", u}});
  double x = 0.0, felt = u[0], now = time[0];
  std::size_t next = 1;
  for (std::size_t i = 1; i < time.size(); ++i) {
    while (next < time.size() && time[next] + delay <= time[i]) {
      x = felt + (x - felt) * std::exp(-a * (time[next] + delay - now));
      now = time[next] + delay;
      felt = u[next++];
    }
    x = felt + (x - felt) * std::exp(-a * (time[i] - now));
    now = time[i];
    EXPECT_NEAR(y[i], x, 5e-4) << time[i];
  }
}

TEST(Equations, WhatAnInstrumentReadsWrongIsAddedToItsOutputAlone) {
  const std::string text =
      "plant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: \"u\", initial: {value: 0, unit: m, sigma: 0}}}\n"
      "outputs: {y: {column: y, expression: \"x\"}}\nparameters: {}\n"
      "terms:\n  - {term: unmodelled, site: output, on: y, over: t, knots: [0, 4], values: [0, 2]}\n"
      "  - {term: unmodelled, site: output, on: y, over: y, knots: [0, 10], values: [0, -1]}\n";
  std::vector<double> time, u;
  for (int i = 0; i < 30; ++i) time.push_back(0.1 * i), u.push_back(1.5);
  const auto y = simulated(text, time, {{"u", u}});
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double drifted = 1.5 * time[i] + 0.5 * time[i];
    EXPECT_NEAR(y[i], drifted - 0.1 * drifted, 1e-9) << time[i];
  }
}

/// x' = a (u - x) where u goes straight from row to row: x = u - r / a beside what dies away, r the slope.
TEST(Equations, WhatIsHeldLinearlyActsStraightFromRowToRow) {
  constexpr double a = 3.0, row = 0.08;
  const std::string text =
      "plant: equations\ncolumns: {time: t}\ninputs: {u: {column: u, hold: linear}}\n"
      "states: {x: {derivative: \"3*(u - x)\", initial: {value: 0, unit: m, sigma: 0}}}\n"
      "outputs: {y: {column: y, expression: \"x\"}}\nparameters: {}\n";
  std::vector<double> time, u;
  for (int i = 0; i < 100; ++i) time.push_back(row * i), u.push_back(std::sin(1.7 * i) + 0.1 * i);
  const auto y = simulated(text, time, {{"u", u}});
  double x = 0.0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    const double slope = (u[i] - u[i - 1]) / row;
    x = u[i] - slope / a + (x - u[i - 1] + slope / a) * std::exp(-a * row);
    EXPECT_NEAR(y[i], x, 1e-4) << time[i];
  }
}

/// A store on the way of an input is a state of the user's own, within the rows too: slow, as fast as these, and far faster.
TEST(Equations, WhatPassesAStoreFadesBetweenTheRows) {
  const auto run = [](const std::string& input, const std::string& rate, const std::string& more,
                      const std::string& term, const std::vector<double>& time,
                      const std::vector<double>& u) {
    const std::string text =
        "plant: equations\ncolumns: {time: t}\ninputs: {u: " + input + "}\nstates:\n  x: {derivative: '4*(" +
        rate + " - x)', initial: {value: 0, unit: m, sigma: 0}}\n" + more +
        "outputs: {y: {column: y, expression: x}}\nparameters: {}\nterms: [" + term + "]\n";
    return simulated(text, time, {{"u", u}});
  };
  std::vector<double> time, u;
  for (int i = 0; i < 200; ++i)
    time.push_back(0.05 * i + (i % 3 == 0 ? 0.01 : 0.0)), u.push_back(i % 7 < 3 ? 1.0 : -0.5);
  for (const char* input : {"u", "{column: u, hold: linear}"})
    for (const char* constant : {"0.3", "0.05", "0.012"}) {
      const std::string tau = constant;
      const auto store = "  z: {derivative: '(u - z)/" + tau + "', initial: {value: 1, unit: m, sigma: 0}}\n";
      const auto lag = run(input, "u", "", "{term: lag, on: u, time_constant: {value: " + tau + ", unit: s}}",
                           time, u),
                 as_lag = run(input, "z", store, "", time, u);
      const auto part = run(input, "u", "",
                            "{term: hidden_state, on: u, coefficient: {value: 0.4, unit: 1}, time_constant: "
                            "{value: " +
                                tau + ", unit: s}}",
                            time, u),
                 as_part = run(input, "(0.6*u + 0.4*z)", store, "", time, u);
      for (std::size_t i = 0; i < time.size(); ++i) {
        ASSERT_NEAR(lag[i], as_lag[i], 2e-4) << input << " " << tau << " row " << i;
        ASSERT_NEAR(part[i], as_part[i], 2e-4) << input << " " << tau << " row " << i;
      }
    }
}

TEST(Equations, TermsActAsTheContractSays) {
  EXPECT_NEAR(last(""), 1.0, 1e-9);
  EXPECT_NEAR(last("{term: upper_limit, on: y, limit: {value: 0.6, unit: m}}"), 0.6, 1e-9);
  EXPECT_NEAR(last("{term: lower_limit, on: y, limit: {value: -0.6, unit: m}}", -0.5), -0.6, 1e-9);
  EXPECT_NEAR(last("{term: upper_limit, on: u, limit: {value: 0.2, unit: 1}}"), 0.4, 1e-9);
  EXPECT_NEAR(last("{term: dead_zone, on: u, width: {value: 0.1, unit: 1}}"), 2.0 * (0.5 - 0.1), 1e-9);
  EXPECT_NEAR(last("{term: delay, on: u, delay: {value: 0.5, unit: s}}", 0.5), 1.0,
              1e-9);  // it was so before
  EXPECT_NEAR(last("{term: delay, on: u, delay: {value: 500, unit: ms}}", 0.5), 1.0, 1e-9);
  const std::string constant = "{term: constant, on: x, value: {value: 0.25, unit: 1}}";
  EXPECT_NEAR(last(constant), 1.5, 1e-6);
  EXPECT_NEAR(last(constant, -0.5), -0.5, 1e-6);
}

TEST(Equations, AnInstrumentThatIsLateShowsWhatWasBetweenTheRows) {
  constexpr double omega = 10.0, tau = 0.03, delay = 0.08;
  const auto shown = [&](const std::string& term) {
    std::vector<double> time;
    for (int i = 0; i < 60; ++i) time.push_back(0.05 * i);  // half a radian: a straight line errs by 0.03
    return simulated(
        "plant: equations\ncolumns: {time: t}\ninputs: {}\nstates:\n"
        "  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0}}\n"
        "  v: {derivative: '-100*x', initial: {value: 10, unit: m/s, sigma: 0}}\n"
        "outputs: {y: {column: y, expression: x}}\nparameters: {}\nterms: [" +
            term + "]\n",
        time, {});
  };
  const auto late = shown("{term: delay, on: y, delay: {value: 0.08, unit: s}}"),
             lagging = shown("{term: lag, on: y, time_constant: {value: 0.03, unit: s}}");
  for (std::size_t i = 0; i < late.size(); ++i) {
    const double t = 0.05 * static_cast<double>(i), a = omega * tau;
    EXPECT_NEAR(late[i], t > delay ? std::sin(omega * (t - delay)) : 0.0, 2e-3) << "row " << i;
    EXPECT_NEAR(lagging[i],
                (std::sin(omega * t) - a * std::cos(omega * t) + a * std::exp(-t / tau)) / (1.0 + a * a),
                2e-3)
        << "row " << i;
  }
}

/// x' = k (u - x) with u from 0 to 1 at the first row and back at each fourth, k h = 10, shown by way of a store.
TEST(Equations, AnInstrumentThatIsLateShowsWhatIsOverBetweenTheRows) {
  constexpr double k = 200.0, tau = 0.02, h = 0.05;
  std::vector<double> time, input;
  for (int i = 0; i < 40; ++i) time.push_back(h * i), input.push_back(i % 8 < 4 ? 1.0 : 0.0);
  for (const char* shown : {"x", "x + u"}) {
    const auto lag = simulated(
        "plant: equations\ncolumns: {time: t}\ninputs: {u: u}\nstates:\n"
        "  x: {derivative: '200*(u - x)', initial: {value: 0, unit: m, sigma: 0}}\n"
        "outputs: {y: {column: y, expression: " +
            std::string{shown} +
            "}}\nparameters: {}\nterms: [{term: lag, on: y, time_constant: {value: 0.02, unit: s}}]\n",
        time, {{"u", input}});
    const bool fed_through = std::string{shown} != "x";
    double x = 0.0, z = fed_through ? 1.0 : 0.0;
    for (std::size_t i = 0; i < time.size(); ++i) {
      EXPECT_NEAR(lag[i], z, 0.02) << shown << " row " << i;
      // Of y = level + off exp(-k t) within the step.
      const double level = input[i] * (fed_through ? 2.0 : 1.0), off = x - input[i],
                   share = off / (1.0 - k * tau);
      z = level + share * std::exp(-k * h) + (z - level - share) * std::exp(-h / tau);
      x = input[i] + off * std::exp(-k * h);
    }
  }
}

TEST(Equations, WhatOnlyTheOthersFeelLeavesAStateAsItIs) {
  const auto shown = [&](const std::string& rate, const std::string& more, const std::string& term) {
    std::vector<double> time;
    for (int i = 0; i <= 60; ++i) time.push_back(0.05 * i);
    return simulated(
        "plant: equations\ncolumns: {time: t}\ninputs: {}\nstates:\n"
        "  a: {derivative: '-a', initial: {value: 1, unit: m, sigma: 0}}\n" +
            more + "  b: {derivative: '" + rate +
            "', initial: {value: 0, unit: m, sigma: 0}}\n"
            "outputs: {y: {column: y, expression: b}}\nparameters: {}\nterms: [" +
            term + "]\n",
        time, {});
  };
  const auto late = shown("a", "", "{term: delay, on: a, with: others, delay: {value: 0.5, unit: s}}"),
             gap = shown("a", "", "{term: dead_zone, on: a, with: others, width: {value: 0.3, unit: m}}"),
             lag = shown("a", "", "{term: lag, on: a, with: others, time_constant: {value: 0.4, unit: s}}"),
             as_lag =
                 shown("z", "  z: {derivative: '(a - z)/0.4', initial: {value: 1, unit: m, sigma: 0}}\n", "");
  for (std::size_t i = 0; i < late.size(); ++i) {
    const double t = 0.05 * static_cast<double>(i), emptied = -std::log(0.3);  // when a is down to the gap
    EXPECT_NEAR(late[i], std::min(t, 0.5) + std::max(0.0, 1.0 - std::exp(-(t - 0.5))), 1e-3) << "row " << i;
    EXPECT_NEAR(gap[i], 1.0 - std::exp(-std::min(t, emptied)) - 0.3 * std::min(t, emptied), 1e-3)
        << "row " << i;
    EXPECT_NEAR(lag[i], as_lag[i], 1e-4) << "row " << i;
  }
}

TEST(Equations, AnOutputThatBearsAStatesNameIsAPlaceOfItsOwn) {
  const auto at = [](const char* place) {
    const std::string text =
        "plant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
        "states: {x: {derivative: u, initial: {value: 0, unit: m, sigma: 0}}}\n"
        "outputs: {x: {column: y, expression: x}}\nparameters: {}\n"
        "terms: [{term: upper_limit, on: " +
        std::string{place} + ", limit: {value: 0.3, unit: m}}]\n";
    std::vector<double> time, input;
    for (int i = 0; i <= 240; ++i) time.push_back(0.005 * i), input.push_back(i < 200 ? 0.5 : -0.5);
    return simulated(text, time, {{"u", input}}).back();  // 0.2 s after it turned
  };
  EXPECT_NEAR(at("x"), 0.2, 1e-3);         // a stop
  EXPECT_NEAR(at("output.x"), 0.3, 1e-9);  // an instrument at its end: the state is at 0.4
}

// --- a loop of the model's own: a term between the controller and the machine

std::vector<double> looped(const std::string& rate, const std::string& more, const std::string& term) {
  const std::string text =
      "plant: equations\ncolumns: {time: t}\ninputs: {r: r, u: u}\nstates:\n"
      "  x: {derivative: '" +
      rate + "', initial: {value: 0, unit: m, sigma: 0}}\n" + more +
      "outputs: {y: {column: y, expression: x}}\nparameters: {}\n"
      "controller: {output: u, expression: '3*(r - x)'}\nterms: [" +
      term + "]\n";
  std::vector<double> time, target;
  for (int i = 0; i <= 800; ++i) time.push_back(0.005 * i), target.push_back(i % 200 < 100 ? 1.0 : -0.5);
  return simulated(text, time, {{"r", target}});
}

TEST(OwnLoop, WhatStandsBetweenControllerAndMachineActs) {
  const auto compare = [](const std::vector<double>& a, const std::vector<double>& b, double within) {
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], within) << "row " << i;
  };
  compare(looped("u - x", "", "{term: dead_zone, on: u, width: {value: 0.2, unit: 1}}"),
          looped("u - max(-0.2, min(0.2, u)) - x", "", ""), 1e-9);
  compare(looped("u - x", "", "{term: upper_limit, on: u, limit: {value: 1.5, unit: 1}}"),
          looped("min(u, 1.5) - x", "", ""), 1e-9);
  compare(looped("u - x", "", "{term: lag, on: u, time_constant: {value: 0.1, unit: s}}"),
          looped("z - x", "  z: {derivative: '(u - z)/0.1', initial: {value: 3, unit: m, sigma: 0}}\n", ""),
          3e-8);
  // What comes late by a step of 0.5 s: until then the first command stands, x' = 3 - x.
  const auto late = looped("u - x", "", "{term: delay, on: u, delay: {value: 0.5, unit: s}}");
  EXPECT_NEAR(late[80], 3.0 * (1.0 - std::exp(-0.4)), 1e-6);
}

}  // namespace
}  // namespace invar::physics
