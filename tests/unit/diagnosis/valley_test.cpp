// Numbers that nearly do the same as what is missing: a ball that hangs under a magnet, whose gravity is known exactly and
// whose magnet's strength is not, and on which something small and steady acts. Made here by a rule and steps of its own.
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/freedom.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double gravity = 9.81, hangs = 0.008, current = 1.2, kp = 380.0, kd = 7.5, tf = 0.002;

/// The loop looks at the gap in every row and holds its current until the next.
Case under_a_magnet(double strength, double steady) {
  std::mt19937 random{4};
  std::normal_distribution<double> noise{0.0, 1.4e-6};
  std::uniform_real_distribution<double> level{-4e-4, 4e-4};
  using State = std::array<double, 3>;  // gap, speed, the gap as the law's filter has it
  State s{hangs, 0.0, hangs};
  std::vector<double> time, wanted, gap;
  double ref = 0.0;
  for (int i = 0; i < 2200; ++i) {
    if (i % 90 == 60) ref = level(random);
    time.push_back(1e-3 * i), wanted.push_back(ref), gap.push_back(s[0] + noise(random));
    const double u = current + kp * (s[0] - hangs - ref) + kd * (s[0] - s[2]) / tf;
    const auto slope = [&](const State& at) {
      return State{at[1], gravity - strength * u * u / (at[0] * at[0]) + steady, (at[0] - at[2]) / tf};
    };
    constexpr int parts = 20;
    constexpr double h = 1e-3 / parts;
    for (int p = 0; p < parts; ++p) {  // the rule of the middle
      const State first = slope(s);
      State half = s;
      for (std::size_t k = 0; k < 3; ++k) half[k] += 0.5 * h * first[k];
      const State middle = slope(half);
      for (std::size_t k = 0; k < 3; ++k) s[k] += h * middle[k];
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("ref", "m", wanted);
  table.add("gap", "m", gap);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {ref: ref}\nstates:\n"
                     "  z: {derivative: v, initial: {value: 0.008, unit: m, sigma: 0}}\n"
                     "  v: {derivative: 'g - K*(u/z)^2', initial: {value: 0, unit: m/s, sigma: 0}}\n"
                     "  zf: {derivative: '(z - zf)/tf', initial: {value: 0.008, unit: m, sigma: 0}}\n"
                     "outputs: {gap: {column: gap, expression: z}}\n"
                     "controller: {output: u, expression: '1.2 + 380*(z - 0.008 - ref) + 7.5*(z - zf)/tf'}\n"
                     "parameters:\n  g: {value: 9.81, unit: m/s2, sigma: 0}\n"
                     "  K: {value: 0.000416, sigma: 0.00002}\n  tf: {value: 0.002, unit: s, sigma: 0}\n"),
      {table});
}

TEST(Valley, ASteadyForceIsFoundBesideANumberThatNearlyDoesTheSame) {
  constexpr double steady = -0.2;
  auto data = under_a_magnet(0.000442, steady);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "constant");
  EXPECT_EQ(d.findings[0].term.on, "v");
  EXPECT_NEAR(d.findings[0].term.values[0], steady, 0.1 * std::abs(steady));
  EXPECT_NEAR(d.best.model.value("K"), 0.000442, 1e-6);
}

/// Runs that differ in a number by little take the same steps: a change a hundred times as large gives the same slope.
TEST(Valley, ASlopeIsThatOfTheMachineAndNotOfItsSteps) {
  const auto data = under_a_magnet(0.000442, 0.0);
  for (int i = 0; i < 20; ++i) {
    const double at = 0.00044 + 2.37e-7 * i;
    auto model = data.model;
    const auto free = freedoms(model, data.model);
    ASSERT_EQ(free.size(), 1U);
    set(model, free[0], at);
    const Eigen::VectorXd slope = sensitivities(data, model, free).col(0);
    const double by = 0.01 * free[0].scale;
    auto before = model, after = model;
    set(before, free[0], at - by), set(after, free[0], at + by);
    const Eigen::VectorXd wide =
        (differences(data, simulate(data, after)) - differences(data, simulate(data, before))) / (2.0 * by);
    EXPECT_LT((slope - wide).norm(), 0.02 * wide.norm()) << at;
  }
}

}  // namespace
}  // namespace invar::diagnosis
