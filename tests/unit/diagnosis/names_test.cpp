// Names beside names: what the noise of a loop or the wrong power of a law must not turn into physics.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/dataset/alike_inputs.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using test::model_of;

/// A carriage behind a dead zone (`width` to either side) in a loop u = kp (r - y), by small steps of Euler's rule.
struct Shaken {
  std::vector<double> time, reference, position, current;
};
Shaken shaken(double width, double sigma, unsigned seed) {
  Shaken s;
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, sigma};
  double x = 0.0, v = 0.0;
  constexpr double mass = 2.0, damping = 40.0, motor = 20.0, kp = 800.0;
  for (int i = 0; i < 6000; ++i) {
    const double t = 1e-3 * i, r = 1e-3 * (1.0 - std::cos(2.0 * 3.14159265358979 * 0.5 * t));
    const double y = x + noise(random), u = kp * (r - y);
    s.time.push_back(t), s.reference.push_back(r), s.position.push_back(y), s.current.push_back(u);
    const double acts = std::abs(u) <= width ? 0.0 : u - std::copysign(width, u);
    for (int part = 0; part < 20; ++part) {
      v += 5e-5 * (motor * acts - damping * v) / mass;
      x += 5e-5 * v;
    }
  }
  return s;
}

TEST(Names, NoiseInALoopSoftensADeadZone) {
  constexpr double width = 0.02, sigma = 2e-5;  // 0.016 A of noise in the command
  const auto truth = shaken(width, sigma, 7);
  recording::Table table;
  table.add("t", "s", truth.time);
  table.add("r", "m", truth.reference);
  table.add("y", "m", truth.position);
  table.add("u", "A", truth.current);
  auto data = make_case(
      model_of("invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
               "controller: {kind: pid, rate: 1000, kp: 800, ki: 0, kd: 0, velocity_filter_hz: 200, limit: "
               "8}\nparameters:\n  mass: {value: 2, unit: kg, sigma: 0}\n  motor_constant: {value: 20, unit: "
               "N/A, sigma: 0}\n  viscous_damping: {value: 40, unit: N s/m, sigma: 0}\nterms:\n  - {term: "
               "dead_zone, width: {value: 0.02, unit: A, sigma: 0}}\n"),
      {table});
  const auto quiet = shaken(width, 0.0, 7);
  // What noise does to the machine on average, from the machine itself.
  std::vector<double> mean(quiet.position.size(), 0.0);
  constexpr int runs = 60;
  for (unsigned seed = 0; seed < runs; ++seed) {
    const auto one = shaken(width, sigma, 100 + seed);
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += (one.position[i] - quiet.position[i]) / runs;
  }
  LoopNoise noise{data};
  noise.take_off(data.model);
  const auto now = noise.now();
  double shift = 0.0, off = 0.0;
  for (std::size_t i = 0; i < mean.size(); ++i) {
    shift += mean[i] * mean[i];
    off += std::pow(truth.position[i] - now[0][0][i] - mean[i], 2);
  }
  EXPECT_GT(std::sqrt(shift / 6000.0), 2e-6);  // there is something to take off
  EXPECT_LT(off, 0.4 * shift);
  noise.put_back();
  EXPECT_EQ(noise.now()[0][0], truth.position);
}

TEST(Names, AnotherPowerGivesAsMuchAtTheSizesThatTheVariableTakes) {
  std::vector<double> time, input, output;
  for (int i = 0; i < 3000; ++i) {
    const double t = 0.01 * i;
    time.push_back(t), input.push_back(20.0 * std::sin(2.0 * t)), output.push_back(0.001 * (i % 2));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "1", input);
  table.add("x", "1", output);
  auto data =
      make_case(model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                         "states: {x: {derivative: 'u', initial: {value: -10, sigma: 0}}}\n"
                         "outputs: {x: {column: x, expression: x}}\nparameters: {}\nterms:\n  - {term: "
                         "quadratic, on: x, coefficient: {value: 1e-9, unit: 1, sigma: 0}}\n"),
                {table});
  // x = -10 cos 2 t: the first harmonic of x |x| is 100 * 0.8488, of x^3 it is 1000 * 0.75, of x it is 10.
  const auto others = other_laws(data, data.model, 0, {});
  bool cubic = false, linear = false;
  for (const auto& other : others) {
    const double strength = other.terms[0].values[0] / 1e-9;
    cubic = cubic || (other.terms[0].info->name == "cubic" && std::abs(strength - 84.88 / 750.0) < 0.01);
    linear = linear || (other.terms[0].info->name == "linear" && std::abs(strength - 8.488) < 0.3);
  }
  EXPECT_TRUE(cubic);
  EXPECT_TRUE(linear);
}

TEST(Names, ASmallShareBesideOthersIsDoubted) {
  EXPECT_LT(odds_of_another_cause(1000.0, 0.0, 0.0, 1.0), 0.1);
  EXPECT_GT(odds_of_another_cause(1000.0, 0.0, 0.0, 2e-4), thresholds::unlikely_odds);
  EXPECT_GT(odds_of_another_cause(20.0, 0.0, 0.0, 1.0), odds_of_another_cause(1000.0, 0.0, 0.0, 1.0));
}

TEST(Names, InputsThatRunAlikeAreCounted) {
  recording::Table table;
  std::vector<double> time, speed, pressure, other, output;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.01 * i;
    time.push_back(t), speed.push_back(std::sin(t)), pressure.push_back(300.0 - 5.0 * std::sin(t));
    other.push_back(std::cos(7.0 * t)), output.push_back(t);
  }
  speed.front() = std::numeric_limits<double>::quiet_NaN();  // an empty cell
  table.add("t", "s", time), table.add("v", "1", speed), table.add("p", "1", pressure);
  table.add("q", "1", other), table.add("y", "1", output);
  const auto data =
      make_case(model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {v: v, p: p, q: q}\n"
                         "outputs: {y: {column: y, expression: 'v + p + q'}}\nparameters: {}\n"),
                {table});
  EXPECT_EQ(inputs_like(data, "v"), 1U);
  EXPECT_EQ(inputs_like(data, "p"), 1U);
  EXPECT_EQ(inputs_like(data, "q"), 0U);
  EXPECT_EQ(inputs_like(data, "t"), 0U);
}

TEST(Names, AnEffectThatIsNothingWithinItsSigmaIsDoubted) {
  Finding finding;
  finding.term.info = physics::find_term(physics::Plant::equations, "lag");
  finding.term.values[0] = 0.335, finding.sigmas = {0.934};
  EXPECT_GT(odds_of_nothing(finding), thresholds::unlikely_odds);
  finding.sigmas = {0.1};  // exp(-0.5 * 3.35^2) = 0.0037
  EXPECT_LT(odds_of_nothing(finding), 0.02);
}

TEST(Names, WhatLeavesMuchBeyondTheNoiseIsDoubtedWhereItActsItself) {
  // The noise has power 1. A half of what there was is left; nothing is; the rest is at an output that it does not move.
  EXPECT_DOUBLE_EQ(rest_beside({0.4}, {0.4}), 0.5);
  EXPECT_DOUBLE_EQ(rest_beside({50.0}, {0.0}), 0.0);
  EXPECT_DOUBLE_EQ(rest_beside({50.0, 0.1}, {0.0, 0.9}), 0.0);
  EXPECT_GT(odds_of_another_cause(50.0, thresholds::plain_rest, 0.0, 1.0), thresholds::unlikely_odds);
}

TEST(Names, TheSameLawOverAVariableThatRunsAlikeIsNoRival) {
  Case data;
  data.model.equations.inputs = {{"u", "u", false}, {"w", "w", false}};
  const auto term = [](const char* name, const char* with) {
    physics::Term t;
    t.info = physics::find_term(physics::Plant::equations, name);
    t.on = std::string{"v"}, t.with = std::string{with};
    return t;
  };
  const auto probability_beside = [&](const physics::Term& other, const char* with = "x") {
    Diagnosis d;
    Finding finding;
    finding.term = term("quadratic", with);
    finding.gain = 1000.0, finding.share = 1.0;
    finding.alternatives.push_back({other, 0.0});
    weigh_name(data, d, 0, 0.0, finding);
    return finding.probability;
  };
  EXPECT_GT(probability_beside(term("quadratic", "y")), 0.9);
  EXPECT_LT(probability_beside(term("cubic", "x")), 0.5);
  // Two inputs are two causes, though nothing tells them apart.
  EXPECT_LE(probability_beside(term("quadratic", "w"), "u"), 0.5);
  EXPECT_LE(probability_beside(term("quadratic", "x"), "u"), 0.5);
}

}  // namespace
}  // namespace invar::diagnosis
