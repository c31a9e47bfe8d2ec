// A ripple along the way and a disturbance in time at a steady speed, where the two are one.
#include "core/diagnosis/search/steady_speed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double pi = std::numbers::pi;

/// A loop that is stepped here by the closed form of a mass with drag: 6 s at one speed, pushed by a ripple of 3 N and 20 mm.
Case steady(double speed) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal;
  constexpr double rate = 1000.0, mass = 5.0, motor = 40.0, drag = 12.0, h = 1.0 / rate;
  const double share = -std::expm1(-2.0 * pi * 200.0 / rate), fades = std::exp(-drag / mass * h),
               moves = mass / drag * (1.0 - fades);
  std::vector<double> time, reference, position, current;
  double x = 0.0, v = 0.0, sum = 0.0, slope = 0.0, last = 0.0;
  for (int k = 0; k < 6000; ++k) {
    const double t = h * k, r = speed * (t < 0.2 ? 2.5 * t * t : t - 0.1), y = x + 1e-7 * normal(random),
                 e = r - y;
    if (k == 0) last = e;
    slope += share * ((e - last) * rate - slope), last = e, sum += e;
    const double u = 3000.0 * e + 5e4 * sum / rate + 30.0 * slope;
    time.push_back(t), reference.push_back(r), position.push_back(y),
        current.push_back(u + 5e-3 * normal(random));
    const double settled = (motor * u + 3.0 * std::sin(2.0 * pi * x / 0.02 + 0.4)) / drag;
    x += settled * h + (v - settled) * moves, v = settled + (v - settled) * fades;
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("r", "m", reference);
  table.add("y", "m", position);
  table.add("u", "A", current);
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
          "controller: {kind: pid, rate: 1000, kp: 3000, ki: 5.0e4, kd: 30, velocity_filter_hz: 200}\n"
          "parameters: {mass: {value: 5.02, unit: kg, sigma: 0.1}, motor_constant: {value: 40, unit: N/A, "
          "sigma: 0.2}, viscous_damping: {value: 12.3, unit: N s/m, sigma: 2}}\nterms: []\n"),
      {table});
}

physics::Term wave(const char* name, double amplitude, double place, double phase) {
  physics::Term term;
  term.info = physics::find_term(physics::Plant::axis, name);
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
    term.values[i] = term.info->parameters[i].starts[0], term.given[i] = true;
  term.values[0] = amplitude, term.values[1] = place, term.values[2] = phase;
  return term;
}

TEST(SteadySpeed, TheTwinIsTheSameForceAtThatSpeed) {
  for (const double speed : {0.05, -0.03}) {
    const auto data = steady(speed);
    for (const auto& term :
         {wave("force_ripple", 3.0, 0.02, 0.4), wave("periodic_disturbance", 2.0, 2.2, -1.1)}) {
      const auto twin = twin_at_steady_speed(data, term);
      ASSERT_TRUE(twin);
      EXPECT_NE(twin->info, term.info);
      const auto& ripple = term.info->name == "force_ripple" ? term : *twin;
      const auto& in_time = term.info->name == "force_ripple" ? *twin : term;
      double most = 0.0;
      for (double t = 1.0; t < 5.0; t += 0.1) {
        const double x = speed * (t - 0.1);
        most = std::max(
            most,
            std::abs(ripple.values[0] * std::sin(2.0 * pi * x / ripple.values[1] + ripple.values[2]) -
                     in_time.values[0] * std::sin(2.0 * pi * in_time.values[1] * t + in_time.values[2])));
      }
      EXPECT_LT(most, 0.1 * term.values[0]) << speed << " m/s, " << term.info->name;
    }
  }
}

TEST(SteadySpeed, ATwinIsNoneOfAMotionThatTurns) {
  auto data = steady(0.05);
  auto& position = data.recordings[0].measured[0];
  for (std::size_t i = 0; i < position.size(); ++i)
    position[i] = 0.1 * std::sin(2.0 * static_cast<double>(i) * 1e-3);
  EXPECT_FALSE(twin_at_steady_speed(data, wave("force_ripple", 3.0, 0.02, 0.4)));
  EXPECT_FALSE(twin_at_steady_speed(steady(0.05), wave("motor_constant_ripple", 0.1, 0.02, 0.4)));
}

TEST(SteadySpeed, ARippleIsNeverCalledADisturbanceWithoutTheRipple) {
  auto data = steady(0.05);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  const auto& finding = d.findings.front();
  if (finding.term.info->name == "force_ripple") return;
  EXPECT_EQ(d.verdict, Verdict::ambiguous) << summary(data, d);
  EXPECT_TRUE(std::any_of(finding.alternatives.begin(), finding.alternatives.end(), [](const Alternative& a) {
    return a.term.info->name == "force_ripple" && a.explains_as_well();
  })) << summary(data, d);
}

}  // namespace
}  // namespace invar::diagnosis
