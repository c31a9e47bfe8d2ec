// A free course beside a name, and in its place: machines made by small steps, with a small effect that no term describes
// beside the chief one.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <random>

#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

const Finding* finding_of(const Diagnosis& d, const std::string& name) {
  for (const auto& finding : d.findings)
    if (finding.term.info->name == name && finding.stand_in == nullptr) return &finding;
  return nullptr;
}

/// w' = 12 u - 3 w - 1.5 sign(w), held at rest, with a drag in one direction alone: 0.35 w^2 where w > 0.
recording::Table motor_with_friction(unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> unit;
  std::uniform_real_distribution<double> level{-1.0, 1.0};
  constexpr double step = 0.01, noise = 0.005, friction = 1.5;
  constexpr int parts = 50;
  std::vector<double> time, volt, speed;
  double u = 0.0, w = 0.0;
  for (int i = 0; i < 1600; ++i) {
    if (i % 80 == 0) u = level(random);
    time.push_back(step * i);
    volt.push_back(u);
    speed.push_back(w + noise * unit(random));
    for (int part = 0; part < parts; ++part) {
      if (w == 0.0 && std::abs(12.0 * u) <= friction) continue;
      const double drag = 0.35 * std::pow(std::max(w, 0.0), 2);
      const double next =
          w + step / parts * (12.0 * u - 3.0 * w - drag - std::copysign(friction, w != 0.0 ? w : u));
      w = w * next < 0.0 ? 0.0 : next;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("volt", "V", volt);
  table.add("speed", "rad/s", speed);
  return table;
}

TEST(BesideCourse, FrictionIsNamedWhereACourseCannotFollowItsJump) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
      "states: {w: {derivative: 'k*u - a*w', initial: {value: 0, unit: rad/s, sigma: 0}}}\n"
      "outputs: {speed: {column: speed, expression: w}}\n"
      "parameters: {k: {value: 12, unit: 1, sigma: 1}, a: {value: 3, unit: 1/s, sigma: 0.5}}\n"
      "noise: {speed: 0.005}\n");
  for (const unsigned seed : {1U, 2U}) {
    auto data = make_case(model, {motor_with_friction(seed)});
    const auto d = diagnose(data, [](double, const std::string&) {});
    const auto* friction = finding_of(d, "dry_friction");
    ASSERT_NE(friction, nullptr) << "seed " << seed;
    EXPECT_NEAR(friction->term.values[0], 1.5, 0.08) << "seed " << seed;
    EXPECT_GT(friction->probability, 0.5) << "seed " << seed;
    EXPECT_NE(d.verdict, Verdict::no_mismatch);
  }
}

/// Two nodes of 2 J/K, one heated, that exchange 5 mW/K; sensors 20 s behind; losses that grow with the temperature.
recording::Table two_nodes(unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> unit;
  std::uniform_int_distribution<int> level{0, 3};
  constexpr double room = 22.0, noise = 0.02, part = 0.05;
  std::vector<double> time, power, one, two, ambient;
  std::array node{room, room}, sensor{room, room};
  double heat = 0.0;
  for (int i = 0; i < 600; ++i) {
    if (i % 90 == 0) heat = 0.3 * level(random);
    time.push_back(i);
    power.push_back(heat);
    one.push_back(sensor[0] + noise * unit(random));
    two.push_back(sensor[1] + noise * unit(random));
    ambient.push_back(room);
    for (int k = 0; k < 20; ++k) {
      const auto loss = [&](double t) { return 0.0085 * (1.0 + 0.0015 * (t - room)) * (t - room); };
      const double exchanged = 0.005 * (node[0] - node[1]);
      for (std::size_t n : {0U, 1U}) sensor[n] += part * (node[n] - sensor[n]) / 20.0;
      const std::array rate{(1.15 * heat - loss(node[0]) - exchanged) / 2.0,
                            (exchanged - loss(node[1])) / 2.0};
      for (std::size_t n : {0U, 1U}) node[n] += part * rate[n];
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("heater", "W", power);
  table.add("T1", "degC", one);
  table.add("T2", "degC", two);
  table.add("room", "degC", ambient);
  return table;
}

TEST(BesideCourse, ACourseOverTimeTakesNothingFromTheExchangeOfHeatAndTheLags) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: thermal\ncolumns: {time: t}\nnodes:\n"
      "  one: {column: T1, capacity: {value: 2, unit: J/K, sigma: 0}, loss: {value: 0.0085, unit: W/K, "
      "sigma: 0.003}}\n"
      "  two: {column: T2, capacity: {value: 2, unit: J/K, sigma: 0}, loss: {value: 0.0085, unit: W/K, "
      "sigma: 0.003}}\n"
      "heaters: {first: {node: one, column: heater, gain: {value: 1, unit: W/W, sigma: 0.3}}}\n"
      "couplings: []\nambient: room\n");
  for (const unsigned seed : {3U, 4U}) {
    auto data = make_case(model, {two_nodes(seed)});
    const auto d = diagnose(data, [](double, const std::string&) {});
    const auto* exchange = finding_of(d, "node_coupling");
    const auto* lag = finding_of(d, "sensor_lag");
    ASSERT_NE(exchange, nullptr) << "seed " << seed;
    ASSERT_NE(lag, nullptr) << "seed " << seed;
    EXPECT_NEAR(exchange->term.values[0], 5e-3, 4e-4) << "seed " << seed;
    EXPECT_NEAR(lag->term.values[0], 20.0, 2.0) << "seed " << seed;
  }
}

}  // namespace
}  // namespace invar::diagnosis
