// The machine's controller against the model's, on a loop that is stepped here by the closed form of a mass with drag.
#include "core/diagnosis/checks/control_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double rate = 1000.0, mass = 5.0, motor = 40.0, drag = 12.0;

struct Law {
  double kp = 8000.0, ki = 2e5, kd = 60.0, filter = 200.0;
  bool of_error = true;    // its derivative is taken of the error; false: of the reading
  double smoothing = 0.0;  // [s] time constant with which the drive smooths the reference it is given
  double rounding = 0.0;   // [A] steps of the command
  double ripple = 0.0;     // [N] of a force with a pitch of 20 mm, which is the plant's
};

/// Two sines and pauses. `seen`: noise that the controller sees; `read`: more of it in what is recorded alone.
recording::Table loop(const Law& law, double seen, double read, double coulomb, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  const double share = -std::expm1(-2.0 * std::numbers::pi * law.filter / rate), h = 1.0 / rate;
  const double fades = std::exp(-drag / mass * h), moves = mass / drag * (1.0 - fades);
  std::vector<double> time, reference, position, current;
  const double follows = law.smoothing > 0.0 ? -std::expm1(-h / law.smoothing) : 1.0;
  double x = 0.0, v = 0.0, sum = 0.0, slope = 0.0, last = 0.0, smooth = 0.0;
  for (int k = 0; k < 9000; ++k) {
    const double t = h * k,
                 gate = std::fmod(t, 3.0) < 2.0 ? std::sin(std::numbers::pi * std::fmod(t, 3.0) / 2.0) : 0.0;
    const double r = gate * gate * (0.02 * std::sin(5.0 * t) + 0.004 * std::sin(31.0 * t));
    smooth += follows * (r - smooth);
    const double y = x + seen * normal(random), e = smooth - y, tracked = law.of_error ? e : -y;
    if (k == 0) last = tracked;
    slope += share * ((tracked - last) * rate - slope), last = tracked;
    sum += e;
    double u = law.kp * e + law.ki * sum / rate + law.kd * slope;
    if (law.rounding > 0.0) u = law.rounding * std::round(u / law.rounding);
    time.push_back(t), reference.push_back(r), position.push_back(y + read * normal(random)),
        current.push_back(u);
    const double force = motor * u - coulomb * std::tanh(v / 2e-4) +
                         law.ripple * std::sin(2.0 * std::numbers::pi * x / 0.02),
                 settled = force / drag;
    x += settled * h + (v - settled) * moves, v = settled + (v - settled) * fades;
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("r", "m", reference);
  table.add("y", "m", position);
  table.add("u", "A", current);
  return table;
}

Case case_of(const recording::Table& table) {
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
          "controller: {kind: pid, rate: 1000, kp: 8000, ki: 2.0e5, kd: 60, velocity_filter_hz: 200}\n"
          "parameters: {mass: {value: 5.05, unit: kg, sigma: 0.1}, motor_constant: {value: 40, unit: N/A, "
          "sigma: 0.2}, viscous_damping: {value: 12.5, unit: N s/m, sigma: 2}}\nterms: []\n"),
      {table});
}

double off(const recording::Table& table) {
  const auto data = case_of(table);
  const auto found = off_the_law(data);
  return found ? found->off / found->all : -1.0;
}

TEST(ControlLaw, TheSameLawIsNoOtherWhateverIsNoisyOrMissing) {
  for (const double coulomb : {0.0, 6.0})
    for (const double read : {0.0, 3e-7}) {
      const double share = off(loop({}, 1e-7, read, coulomb, 4));
      EXPECT_GE(share, 0.0);
      EXPECT_LT(share, 0.01) << coulomb << " N, " << read << " m";
    }
}

TEST(ControlLaw, AnotherGainOrAnotherDerivativeIsSeen) {
  EXPECT_GT(off(loop({.kp = 8800.0}, 1e-7, 0.0, 0.0, 4)), 0.05);
  EXPECT_GT(off(loop({.ki = 1.7e5}, 1e-7, 3e-7, 0.0, 4)), 0.05);
  EXPECT_GT(off(loop({.of_error = false}, 1e-7, 0.0, 6.0, 4)), 0.05);
}

/// Of the mismatch of the position, the share that goes away in a loop that departs from its law as this one did.
double share_of(const Law& law, double coulomb) {
  const auto data = case_of(loop(law, 1e-7, 0.0, coulomb, 4));
  return share_of_law(data, data.model);
}

TEST(ControlLaw, TellsHowMuchOfTheMismatchIsTheLaws) {
  EXPECT_GT(share_of({.kp = 8800.0}, 0.0), 0.8);
  EXPECT_GT(share_of({.of_error = false}, 0.0), 0.8);
  EXPECT_GT(share_of({.smoothing = 2e-4}, 0.0), 0.7);
  // Beside a large effect of the plant the same departures are trifles.
  EXPECT_LT(share_of({.smoothing = 2e-4, .ripple = 4.0}, 0.0), 0.1);
  EXPECT_LT(share_of({.filter = 300.0, .ripple = 4.0}, 0.0), 0.1);
  EXPECT_LT(share_of({.rounding = 0.01, .ripple = 4.0}, 0.0), 0.1);
}

TEST(ControlLaw, ADriveThatSmoothsItsReferenceDoesNotHideARipple) {
  auto data = case_of(loop({.smoothing = 3e-4, .ripple = 2.0}, 1e-7, 0.0, 0.0, 4));
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_TRUE(d.off_law);
  EXPECT_TRUE(d.off_law->is_beside()) << d.off_law->off << " A, " << d.off_law->share;
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  EXPECT_EQ(d.findings.front().term.info->name, "force_ripple") << summary(data, d);
  EXPECT_NEAR(d.findings.front().term.values[d.findings.front().term.info->index_of("amplitude")], 2.0, 0.1);
  EXPECT_NE(summary(data, d).find("look at the controller block"), std::string::npos) << summary(data, d);
}

TEST(ControlLaw, NothingBehindALoopOfAnotherLawIsNamed) {
  auto data = case_of(loop({.kp = 8800.0}, 1e-7, 0.0, 0.0, 4));
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  EXPECT_TRUE(d.findings.empty());
  ASSERT_TRUE(d.suspect);
  EXPECT_EQ(d.suspect->site, "axis.controller");
  EXPECT_NE(summary(data, d).find("controller block"), std::string::npos) << summary(data, d);
  EXPECT_EQ(d.best.model.value("mass"), 5.05);
}

}  // namespace
}  // namespace invar::diagnosis
