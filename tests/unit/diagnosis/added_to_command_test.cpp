// What stands in the recorded current beside the controller's law, on loops that are stepped here by the closed form of a mass
// with drag: a wave, an offset, a limit, steps, a dead zone, a delay; and loops in which nothing does.
#include "core/diagnosis/checks/added_to_command.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <numbers>
#include <random>

#include "core/diagnosis/checks/control_law.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double rate = 1000.0, mass = 5.0, motor = 40.0, drag = 12.0, pi = std::numbers::pi;

using Change = std::function<double(double command, double time)>;

struct Loop {
  bool is_cascade = false;
  Change drive = [](double u, double) { return u; };  // between controller and motor
  Change meter = [](double u, double) { return u; };  // of the recorded current alone
  std::size_t late = 0;                               // cycles, before the drive
  double stiffer = 1.0;                               // another gain than the model's
  double seen = 1e-7;                                 // [m] noise that the controller sees
  double read = 0.0;                                  // [m] and more of it in the recording alone
  double step = 0.0;                                  // [m] of the encoder
  double ammeter = 5e-3;                              // [A] noise of the recorded current
};

/// 9 s: two sines and pauses.
recording::Table record(const Loop& loop, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  const double share = -std::expm1(-2.0 * pi * 200.0 / rate), h = 1.0 / rate,
               fades = std::exp(-drag / mass * h), moves = mass / drag * (1.0 - fades);
  std::vector<double> time, reference, position, current;
  std::deque<double> queue(loop.late, 0.0);
  double x = 0.0, v = 0.0, sum = 0.0, slope = 0.0, last = 0.0;
  for (int k = 0; k < 9000; ++k) {
    const double t = h * k, part = std::fmod(t, 3.0),
                 gate = part < 2.0 ? std::pow(std::sin(0.5 * pi * part), 2.0) : 0.0,
                 r = gate * (0.02 * std::sin(5.0 * t) + 0.004 * std::sin(31.0 * t));
    double y = x + loop.seen * normal(random);
    if (loop.step > 0.0) y = loop.step * std::round(y / loop.step);
    const double e = r - y, tracked = loop.is_cascade ? y : e;
    if (k == 0) last = tracked;
    slope += share * ((tracked - last) * rate - slope), last = tracked;
    sum += e;
    const double asked = loop.is_cascade ? 30.0 * (60.0 * loop.stiffer * e - slope)
                                         : 3000.0 * loop.stiffer * e + 5e4 * sum / rate + 30.0 * slope;
    queue.push_back(asked);
    const double u = loop.drive(queue.front(), t);
    queue.pop_front();
    time.push_back(t), reference.push_back(r), position.push_back(y + loop.read * normal(random));
    current.push_back(loop.meter(u, t) + loop.ammeter * normal(random));
    const double settled = motor * u / drag;
    x += settled * h + (v - settled) * moves, v = settled + (v - settled) * fades;
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("r", "m", reference);
  table.add("y", "m", position);
  table.add("u", "A", current);
  return table;
}

Case case_of(const Loop& loop, unsigned seed = 7) {
  const std::string controller =
      loop.is_cascade ? "{kind: cascade, rate: 1000, kp: 60, kv: 30, velocity_filter_hz: 200}"
                      : "{kind: pid, rate: 1000, kp: 3000, ki: 5.0e4, kd: 30, velocity_filter_hz: 200}";
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
          "controller: " +
          controller +
          "\nparameters: {mass: {value: 5.02, unit: kg, sigma: 0.1}, motor_constant: {value: 40, unit: N/A, "
          "sigma: 0.2}, viscous_damping: {value: 12.3, unit: N s/m, sigma: 2}}\nterms: []\n"),
      {record(loop, seed)});
}

Change square(double amplitude, double hertz, double about = 0.0) {
  return [=](double u, double t) {
    return u + about + (std::sin(2.0 * pi * hertz * (t + 0.1037)) >= 0.0 ? amplitude : -amplitude);
  };
}
Change sine(double amplitude, double hertz) {
  return [=](double u, double t) { return u + amplitude * std::sin(2.0 * pi * hertz * t + 0.7); };
}
Change offset(double by) {
  return [=](double u, double) { return u + by; };
}
Change limit(double at) {
  return [=](double u, double) { return std::clamp(u, -at, at); };
}
Change steps(double step) {
  return [=](double u, double) { return step * std::round(u / step); };
}
Change dead_zone(double width) {
  return [=](double u, double) { return std::copysign(std::max(0.0, std::abs(u) - width), u); };
}

std::optional<Added> added(const Loop& loop) {
  const auto data = case_of(loop);
  return added_to_command(data, rows_of_law(data));
}

double value(const physics::Term& term, const char* parameter) {
  return term.values[term.info->index_of(parameter)];
}

TEST(AddedToCommand, AWaveIsSeenInTheCurrentWithItsSizeAndFrequency) {
  for (const bool is_cascade : {false, true}) {
    for (const double size : {0.4, 0.02}) {
      const auto found = added({.is_cascade = is_cascade, .drive = square(size, 1.3)});
      ASSERT_TRUE(found) << size;
      EXPECT_EQ(found->term.info->name, "additive_disturbance") << found->words;
      EXPECT_EQ(value(found->term, "squareness"), 1.0) << found->words;
      EXPECT_NEAR(value(found->term, "amplitude"), size, 0.03 * size + 2e-4);
      EXPECT_NEAR(value(found->term, "frequency"), 1.3, 0.005);
    }
    const auto hum = added({.is_cascade = is_cascade, .drive = sine(0.01, 7.0)});
    ASSERT_TRUE(hum);
    EXPECT_EQ(value(hum->term, "squareness"), 0.0) << hum->words;
    EXPECT_NEAR(value(hum->term, "amplitude"), 0.01, 5e-4);
    EXPECT_NEAR(value(hum->term, "frequency"), 7.0, 0.02);
    EXPECT_NEAR(value(hum->term, "phase"), 0.7, 0.1);
  }
}

TEST(AddedToCommand, PulsesOneWayAreAWaveAboutALevelWhereTheLawHasNoSum) {
  const auto found = added({.is_cascade = true, .drive = square(0.3, 2.0, 0.3)});
  ASSERT_TRUE(found);
  EXPECT_NEAR(value(found->term, "offset"), 0.3, 0.01) << found->words;
}

TEST(AddedToCommand, AnOffsetALimitStepsAndADeadZoneAreToldApart) {
  const auto shifted = added({.is_cascade = true, .drive = offset(-0.05)});
  ASSERT_TRUE(shifted);
  EXPECT_EQ(shifted->term.curve.over, "time") << shifted->words;
  EXPECT_NEAR(shifted->term.curve.values[0], -0.05, 1e-3);
  for (const bool is_cascade : {false, true}) {
    const auto limited = added({.is_cascade = is_cascade, .drive = limit(0.45)});
    ASSERT_TRUE(limited);
    ASSERT_EQ(limited->term.curve.knots.size(), 4U) << limited->words;
    EXPECT_NEAR(limited->term.curve.knots[2], 0.45, 0.01);
    const auto stepped = added({.is_cascade = is_cascade, .drive = steps(0.05)});
    ASSERT_TRUE(stepped);
    EXPECT_NEAR(stepped->term.curve.period, 0.05, 5e-4) << stepped->words;
    const auto dead = added({.is_cascade = is_cascade, .drive = dead_zone(0.04)});
    ASSERT_TRUE(dead);
    EXPECT_EQ(dead->term.info->name, "dead_zone") << dead->words;
    EXPECT_NEAR(dead->term.values[0], 0.04, 2e-3);
  }
}

TEST(AddedToCommand, ADelayIsSeenWhateverNoiseIsReadBeside) {
  for (const bool is_cascade : {false, true})
    for (const double read : {0.0, 3e-7}) {
      const auto late = added({.is_cascade = is_cascade, .late = 2, .read = read});
      ASSERT_TRUE(late) << is_cascade << " " << read;
      EXPECT_EQ(late->term.info->name, "transport_delay") << late->words;
      EXPECT_NEAR(late->term.values[0], 1.5e-3, 1e-9);
    }
}

TEST(AddedToCommand, NothingIsClaimedOfNoiseCoarseStepsOrAnotherGain) {
  for (const bool is_cascade : {false, true}) {
    for (const double read : {0.0, 3e-7, 1e-6})
      for (const double step : {0.0, 1e-6, 1e-5})
        for (const double ammeter : {0.0, 0.02}) {
          const auto found =
              added({.is_cascade = is_cascade, .read = read, .step = step, .ammeter = ammeter});
          EXPECT_FALSE(found) << is_cascade << " " << read << " m, " << step << " m, " << ammeter
                              << " A: " << found->words;
        }
    const auto found = added({.is_cascade = is_cascade, .stiffer = 1.1});
    EXPECT_FALSE(found) << found->words;
  }
}

TEST(AddedToCommand, NothingIsClaimedOfHowFinelyAFileWasWritten) {
  for (const double last_digit : {1e-5, 3e-6, 1e-6, 1e-7, 1e-8}) {
    const auto found = added(
        {.meter = [=](double u, double) { return last_digit * std::round(u / last_digit); }, .ammeter = 0.0});
    EXPECT_FALSE(found) << last_digit << " A: " << found->words;
  }
}

TEST(AddedToCommand, TheCarriageFeelsWhatIsAddedAndNotWhatIsMisread) {
  for (const bool is_cascade : {false, true}) {
    auto data = case_of({.is_cascade = is_cascade, .drive = sine(0.1, 7.0)});
    EXPECT_NEAR(felt_by_carriage(data, rows_of_law(data)), 1.0, 0.1);
    settle_recorded_current(data);
    EXPECT_TRUE(data.model.records_applied);
    auto misread = case_of({.is_cascade = is_cascade, .meter = sine(0.1, 7.0)});
    EXPECT_NEAR(felt_by_carriage(misread, rows_of_law(misread)), 0.0, 0.1);
    settle_recorded_current(misread);
    EXPECT_FALSE(misread.model.records_applied);
    ASSERT_EQ(misread.doubts.size(), 1U);
    EXPECT_NE(misread.doubts[0].find("does not feel"), std::string::npos);
  }
}

TEST(AddedToCommand, WhatTheModelAddsItselfIsNotFoundAgain) {
  auto data = case_of({.is_cascade = true, .drive = square(0.3, 2.0, 0.3)});
  settle_recorded_current(data);
  ASSERT_TRUE(data.beside_law);
  data.model.terms.push_back(*data.beside_law);
  EXPECT_FALSE(added_to_command(data, rows_of_law(data)));
  auto late = case_of({.late = 2});
  settle_recorded_current(late);
  ASSERT_TRUE(late.beside_law);
  late.model.terms.push_back(*late.beside_law);
  EXPECT_TRUE(rows_of_law(late).empty());
}

TEST(AddedToCommand, ThePatchedFileSaysWhereTheCurrentIsRecorded) {
  const auto yaml = config::Yaml::parse(
      "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
      "controller: {kind: cascade, rate: 1000, kp: 60, kv: 30}\n"
      "parameters: {mass: {value: 5, unit: kg}, motor_constant: {value: 40, unit: N/A}, "
      "viscous_damping: {value: 12, unit: N s/m}}\nterms: []\n",
      "model.yaml");
  auto changed = model::read(yaml);
  EXPECT_FALSE(changed.records_applied);
  EXPECT_EQ(model::patched(yaml, changed).find("applied"), std::string::npos);
  changed.records_applied = true;
  changed.terms.emplace_back();
  auto& term = changed.terms.back();
  term.info = physics::unmodelled(physics::Plant::axis, "actuator");
  term.with = "command", term.curve.over = "current";
  term.curve.knots = {-1.0, -0.3, 0.3, 1.0}, term.curve.values = {0.7, 0.0, 0.0, -0.7};
  const auto again = test::model_of(model::patched(yaml, changed));
  EXPECT_TRUE(again.records_applied);
  ASSERT_EQ(again.terms.size(), 1U);
  EXPECT_EQ(again.terms[0].with, "command");
  // A loop that is asked to jump by 0.4 mm commands 0.72 A; what is recorded is the limit.
  physics::Record inputs;
  inputs.time = {0.0, 1e-3, 2e-3};
  inputs.signals["reference"] = {0.0, 4e-4, 4e-4};
  physics::Outputs recorded;
  physics::prepare(again, inputs)->run(again, recorded);
  EXPECT_NEAR(recorded[1][1], 0.3, 1e-9);
}

Diagnosis diagnosed(const Loop& loop) {
  auto data = case_of(loop);
  auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_TRUE(data.model.records_applied);
  EXPECT_EQ(d.findings.size(), 1U) << summary(data, d);
  if (!d.findings.empty()) {
    EXPECT_EQ(d.findings[0].term.info->site, "actuator") << summary(data, d);
  }
  for (const auto& row : d.heldout) {
    EXPECT_LT(row.after, 4.0 * row.noise_floor) << summary(data, d);
  }
  EXPECT_LT(d.heldout.at(0).after, 0.2 * d.heldout.at(0).before) << summary(data, d);
  return d;
}

TEST(AddedToCommand, PulsesAreNamedAndSimulated) {
  const auto d = diagnosed({.is_cascade = true, .drive = square(0.3, 2.0, 0.3)});
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "additive_disturbance");
  EXPECT_GT(d.findings[0].probability, 0.9);
}

TEST(AddedToCommand, ADelayedCurrentIsNamed) {
  const auto d = diagnosed({.late = 2});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "transport_delay");
}

TEST(AddedToCommand, AnOffsetAndALimitHaveACurveAtTheDrive) {
  for (const auto& drive : {offset(0.2), limit(0.45)}) {
    const auto d = diagnosed({.is_cascade = true, .drive = drive});
    EXPECT_EQ(d.verdict, Verdict::unknown_physics);
    ASSERT_EQ(d.findings.size(), 1U);
    EXPECT_EQ(d.findings[0].term.with, "command");
  }
}

}  // namespace
}  // namespace invar::diagnosis
