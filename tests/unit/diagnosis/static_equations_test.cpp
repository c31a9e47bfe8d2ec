// Equations in which nothing moves: what an output lacks goes with an input, row by row.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/config/yaml.hpp"
#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using test::model_of;
using ::testing::HasSubstr;

const char* const joint =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: angle, w: speed}\n"
    "outputs: {torque: {column: tau, expression: 'F0 + Fv*w'}}\n"
    "parameters:\n  F0: {value: 0, unit: N m, sigma: 0.3}\n  Fv: {value: 2, unit: N m s, sigma: 2}\n";

/// A joint that goes to and fro; `friction` [N m] of constant size, `ripple` [N m] five times a turn. `toward`: -1 where the
/// sensor counts what the joint feels and not what drives it.
Case moved(const physics::Model& model, double friction, double ripple, double toward) {
  std::mt19937 random{3};
  std::normal_distribution<double> normal;
  std::vector<double> time, angle, speed, torque;
  for (int i = 0; i < 1500; ++i) {
    const double t = 0.02 * i, q = 2.0 * std::sin(0.7 * t) + 0.8 * std::sin(1.9 * t),
                 w = 1.4 * std::cos(0.7 * t) + 1.52 * std::cos(1.9 * t);
    time.push_back(t), angle.push_back(q), speed.push_back(w);
    torque.push_back(0.1 + 2.5 * w + toward * friction * (w > 0.0 ? 1.0 : -1.0) + ripple * std::sin(5.0 * q) +
                     0.1 * normal(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("angle", "rad", angle);
  table.add("speed", "rad/s", speed);
  table.add("tau", "N m", torque);
  return make_case(model, {table});
}

TEST(StaticEquations, FrictionOverASpeedIsNamedAtTheTorqueWhicheverWayItCounts) {
  for (const double toward : {1.0, -1.0}) {
    auto data = moved(model_of(joint), 0.35, 0.0, toward);
    const auto d = diagnose(data, [](double, const std::string&) {});
    ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
    const auto& term = d.findings[0].term;
    EXPECT_EQ(term.info->name, "dry_friction");
    EXPECT_EQ(term.on, "torque");
    EXPECT_EQ(term.with, "w");
    EXPECT_NEAR(term.values[0], toward * 0.35, 0.03);
    EXPECT_EQ(site_of(data, term), "equations.output");
    EXPECT_EQ(d.verdict, Verdict::explained) << summary(data, d);
    EXPECT_NEAR(d.heldout[0].after, 0.1, 0.01);
  }
}

TEST(StaticEquations, WhatIsWholeIsNoMismatch) {
  auto data = moved(model_of(joint), 0.0, 0.0, 1.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch) << summary(data, d);
}

TEST(StaticEquations, ARippleOverTheAngleIsFoundToGoWithIt) {
  auto data = moved(model_of(joint), 0.0, 0.4, 1.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.info->name, "periodic") << summary(data, d);
  EXPECT_EQ(term.with, "q");
  EXPECT_NEAR(term.values[1], 2.0 * std::numbers::pi / 5.0, 0.01);
  EXPECT_LT(d.heldout[0].after, 0.5 * d.heldout[0].retuned) << summary(data, d);
}

TEST(StaticEquations, AFileWithSuchATermSimulatesItAndOneThatNamesNoVariableIsRefused) {
  const auto with = [](const std::string& more) {
    return std::string{joint} + "terms: [{term: dry_friction, on: torque" + more +
           ", level: {value: 0.35}}]\n";
  };
  physics::Record inputs;
  inputs.time = {0.0, 1.0, 2.0};
  inputs.signals["w"] = {1.0, -1.0, 0.0};
  inputs.signals["q"] = {0.0, 0.0, 0.0};
  const auto model = model_of(with(", with: w"));
  physics::Outputs outputs;
  physics::prepare(model, inputs)->run(model, outputs);
  EXPECT_THAT(outputs.at(0), ::testing::ElementsAre(2.35, -2.35, 0.0));
  try {
    (void)model_of(with(""));
    FAIL() << "a friction that goes with nothing was read";
  } catch (const std::exception& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("under `with`"));
  }
}

}  // namespace
}  // namespace invar::diagnosis
