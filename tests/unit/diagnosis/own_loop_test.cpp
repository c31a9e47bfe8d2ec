// Loops that the user wrote down, against a cart made here: its controller reads with noise, and the noise goes round.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/locate/what_looks_at_what.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/record_file.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// A cart that is pushed as its controller reads it, exact between rows; what is commanded may arrive late. Its speed may be
/// read too, by an instrument that is far quieter than what the other's noise makes of the speed.
Case cart(double push, double lag, bool reads_speed = false) {
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  constexpr double h = 0.02;
  std::vector<double> time, target, command, reading, speed;
  double x = 0.0, v = 0.0, felt = 0.0, to = 0.0;
  for (int i = 0; i < 2000; ++i) {
    if (i % 150 == 149) to = std::uniform_real_distribution<double>{-0.3, 0.3}(random);
    const double read = x + 2e-3 * normal(random), u = 9.0 * (to - read) - 4.0 * v;
    time.push_back(h * i), target.push_back(to), command.push_back(u), reading.push_back(read);
    if (reads_speed) speed.push_back(v + 1e-4 * normal(random));
    for (int part = 0; part < 40; ++part) {
      const double s = h / 40.0, kept = lag > 0.0 ? std::exp(-s / lag) : 0.0;
      felt = u + (felt - u) * kept;
      const double a = 1.1 * felt - 0.3 * v + push;
      x += s * (v + 0.5 * s * a);
      v += s * a;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("to", "m", target);
  table.add("u", "", command);
  table.add("y", "m", reading);
  if (reads_speed) table.add("w", "m/s", speed);
  const std::string outputs =
      reads_speed
          ? "{y: {column: y, expression: x}, w: {column: w, expression: v}}\nnoise: {y: 0.002, w: 1e-4}\n"
          : "{y: {column: y, expression: x}}\nnoise: {y: 0.002}\n";
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {r: to, u: u}\nstates:\n"
                     "  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0.01}}\n"
                     "  v: {derivative: 'k*u - c*v', initial: {value: 0, unit: m/s, sigma: 0.01}}\n"
                     "outputs: " +
                     outputs +
                     "controller: {output: u, expression: '9*(r - x) - 4*v'}\n"
                     "parameters:\n  k: {value: 1.08, unit: 1/kg, sigma: 0.03}\n"
                     "  c: {value: 0.32, unit: 1/s, sigma: 0.05}\n"),
      {table});
}

TEST(OwnLoop, WhatOnlyTheControllerLooksAtIsNoStateOfTheMachine) {
  physics::Equations loop;
  loop.states = {{"x", "v"},
                 {"v", "k*felt - c*v"},
                 {"felt", "(u - felt)/tau"},
                 {"xf", "(x - xf)/tf"},
                 {"sum", "r - xf"}};
  loop.inputs = {{"r", "r"}, {"u", "u"}};
  loop.outputs = {{"y", "x + 0.1*felt", {}}};
  loop.controlled_input = "u";
  loop.control_law = "kp*(r - x) - kd*(x - xf)/tf + ki*sum";
  std::string names;
  for (const auto& state : states_of_machine(loop)) names += state.name + " ";
  EXPECT_EQ(names, "x v felt ");
  loop.outputs.push_back({"filtered", "xf", {}});  // which somebody recorded
  EXPECT_EQ(states_of_machine(loop).size(), 4U);
  loop.outputs = {{"command", "u", {}}};  // all that is recorded
  EXPECT_EQ(states_of_machine(loop).size(), 5U);
  loop.controlled_input.clear();
  EXPECT_EQ(states_of_machine(loop).size(), 5U);
}

TEST(OwnLoop, TheNoiseThatGoesRoundInItIsNoPhysics) {
  auto data = cart(0.0, 0.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
}

TEST(OwnLoop, AForceIsExplainedThoughTheNoiseGoesRound) {
  auto data = cart(0.08, 0.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "constant");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.08, 0.004);
}

TEST(OwnLoop, ANoisyReadingMakesTheOtherOutputsLouderAndNoNameWorse) {
  auto data = cart(0.08, 0.0, true);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "constant");
  EXPECT_GT(d.findings[0].probability, 0.8);
}

/// A ball on a beam whose controller reads it with noise; it rolls with friction and, the beam not being level, down it.
Case ball(double friction, double down) {
  std::mt19937 random{6};
  std::normal_distribution<double> noise{0.0, 1.5e-4};
  std::uniform_real_distribution<double> place{-0.15, 0.15};
  constexpr double row = 0.04, g = 7.2, ta = 0.055, kp = 0.6, kd = 0.42, tf = 0.05;
  std::vector<double> time, target, reading;
  double x = 0.0, v = 0.0, tilt = 0.0, felt = 0.0, from = 0.0, to = 0.0;
  for (int i = 0; i < 1200; ++i) {
    if (i % 50 == 0) from = to, to = place(random);
    const double ref = from + (to - from) * std::min(1.0, (i % 50) / 25.0), read = x + noise(random);
    time.push_back(row * i), target.push_back(ref), reading.push_back(read);
    const double u = kp * (ref - read) - kd * (read - felt) / tf;
    constexpr int parts = 400;
    constexpr double h = row / parts;
    for (int part = 0; part < parts; ++part) {
      const double pull = g * std::sin(tilt) + down, way = std::copysign(1.0, v != 0.0 ? v : pull);
      const double next = v + h * (pull - friction * way);
      v = (v == 0.0 && std::abs(pull) <= friction) || next * way < 0.0 ? 0.0 : next;
      x += h * v;
      tilt += h * (u - tilt) / ta;
      felt += h * (x - felt) / tf;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("ref", "m", target);
  table.add("y", "m", reading);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {ref: ref}\nstates:\n"
                     "  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0}}\n"
                     "  v: {derivative: 'g*sin(al)', initial: {value: 0, unit: m/s, sigma: 0}}\n"
                     "  al: {derivative: '(u - al)/ta', initial: {value: 0, unit: rad, sigma: 0}}\n"
                     "  xf: {derivative: '(x - xf)/tf', initial: {value: 0, unit: m, sigma: 0}}\n"
                     "outputs: {y: {column: y, expression: x}}\n"
                     "controller: {output: u, expression: '0.6*(ref - x) - 0.42*(x - xf)/tf'}\n"
                     "parameters:\n  g: {value: 7.4, unit: m/s2, sigma: 0.37}\n"
                     "  ta: {value: 0.06, unit: s, sigma: 0.009}\n  tf: {value: 0.05, unit: s, sigma: 0}\n"),
      {table});
}

TEST(OwnLoop, ASteadyPushBesideFrictionIsFoundToo) {
  auto data = ball(0.0021, 0.0018);
  const auto d = diagnose(data, [](double, const std::string&) {});
  // The controller feeds the noise of its readings back: the ball wanders by more than twice that noise, which nothing explains.
  EXPECT_EQ(d.verdict, Verdict::partly_explained) << summary(data, d);
  ASSERT_EQ(d.findings.size(), 2U);
  const bool is_first = d.findings[0].term.info->name == "constant";
  const auto &steady = d.findings[is_first ? 0 : 1].term, &rubs = d.findings[is_first ? 1 : 0].term;
  EXPECT_EQ(steady.info->name, "constant");
  EXPECT_EQ(rubs.info->name, "dry_friction");
  EXPECT_NEAR(rubs.values[0], 0.0021, 0.0003);
}

TEST(OwnLoop, WhatTheControllerDecidesNeedNotBeListedAmongTheInputs) {
  const std::string
      listed = "inputs: {r: to, u: u}",
      rest =
          "\nstates:\n  v: {derivative: 'u - v', initial: {value: 0, unit: m, sigma: 0}}\n"
          "outputs: {y: {column: y, expression: v}}\ncontroller: {output: u, expression: '9*(r - v)'}\n",
      head = "invar_model: 1\nplant: equations\ncolumns: {time: t}\n";
  recording::Table table;
  std::vector<double> time, target;
  for (int i = 0; i < 50; ++i) time.push_back(0.01 * i), target.push_back(i < 10 ? 0.0 : 1.0);
  table.add("t", "s", time);
  table.add("to", "m", target);
  const auto run = [&](const std::string& inputs) {
    const auto model = test::model_of(head + inputs + rest);
    physics::Outputs outputs;
    physics::prepare(model, model::to_record(table, model, false).record)->run(model, outputs);
    return outputs;
  };
  EXPECT_EQ(run("inputs: {r: to}"), run(listed));
  EXPECT_GT(run(listed)[0].back(), 0.8);
}

TEST(OwnLoop, WhatTheControllerDecidesMayArriveLate) {
  auto data = cart(0.0, 0.12);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "lag");
  EXPECT_EQ(d.findings[0].term.on, "u");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.12, 0.01);
}

TEST(OwnLoop, ATermAtAStateIsThereThoughAnOutputBearsItsName) {
  Case data;
  data.model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: 'u - x', initial: {value: 0, unit: m}}}\n"
      "outputs: {x: {column: x, expression: x}}\nparameters: {}\n");
  physics::Term drag;
  drag.info = physics::find_term(physics::Plant::equations, "quadratic");
  drag.on = "x";
  EXPECT_EQ(site_of(data, drag), "equations.x");
  EXPECT_EQ(place_of(data, drag), "state x");
  for (auto& signal : data.model.signals) signal.unit = "m";
  EXPECT_EQ(unit_of(data, drag, 0), "m/s/m2");  // of a rate, over the square of x
  drag.info = physics::find_term(physics::Plant::equations, "constant");
  EXPECT_EQ(unit_of(data, drag, 0), "m/s");
  drag.info = physics::find_term(physics::Plant::equations, "periodic");
  EXPECT_EQ(unit_of(data, drag, 1), "m");
  drag.info = physics::find_term(physics::Plant::equations, "lag");
  drag.on = "output.x";
  EXPECT_EQ(site_of(data, drag), "equations.output");
  EXPECT_EQ(place_of(data, drag), "output x");
  EXPECT_EQ(unit_of(data, drag, 0), "s");
}

TEST(OwnLoop, NumbersHaveTheUnitOfAStateThatIsRecordedUnderAnotherNameOrByNobody) {
  Case data;
  data.model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states:\n  v: {derivative: 'u - v', initial: {value: 0, unit: m/s}}\n"
      "  hidden: {derivative: 'v - hidden', initial: {value: 0, unit: K}}\n"
      "outputs: {speed: {column: w, expression: v}}\nparameters: {}\n");
  physics::Term term;
  term.info = physics::find_term(physics::Plant::equations, "quadratic");
  for (const auto& [place, quadratic, constant] :
       {std::array{"v", "m/s2/(m/s)2", "m/s2"}, std::array{"hidden", "K/s/K2", "K/s"}}) {
    term.on = place;
    term.info = physics::find_term(physics::Plant::equations, "quadratic");
    EXPECT_EQ(unit_of(data, term, 0), quadratic);
    term.info = physics::find_term(physics::Plant::equations, "constant");
    EXPECT_EQ(unit_of(data, term, 0), constant);
    term.info = physics::find_term(physics::Plant::equations, "hidden_state");
    EXPECT_EQ(unit_of(data, term, 0), "1/s");  // the rate of a difference of two alike
  }
  term.on = "u";
  EXPECT_EQ(unit_of(data, term, 0), "1");
}

}  // namespace
}  // namespace invar::diagnosis
