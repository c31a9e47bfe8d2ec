// Recordings whose rows are not the cycles that the machine went through: every other cycle of a controller, and stamps that
// scatter about even steps.
#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using ::testing::HasSubstr;

constexpr double axis_noise = 2e-7;

physics::Model axis(const std::string& hold) {
  return test::model_of(
      "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
      "controller: {kind: pid, rate: 1000, kp: 4e3, ki: 2e4, kd: 60, velocity_filter_hz: 200, limit: 8" +
      hold +
      "}\nparameters:\n  mass: {value: 3.2, unit: kg, sigma: 0.06}\n"
      "  motor_constant: {value: 20, unit: N/A, sigma: 0.2}\n"
      "  viscous_damping: {value: 8, unit: N s/m, sigma: 2}\nnoise: {y: 2e-7}\n");
}

/// Every other cycle of the loop. `held`: its reference moves with the rows alone, else with every cycle.
recording::Table every_other_cycle(bool held) {
  constexpr unsigned seed = 4;
  std::cout << "seed " << seed << '\n';
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, axis_noise};
  physics::Record inputs;
  auto& reference = inputs.signals["reference"];
  for (int k = 0; k < 8000; ++k) {
    inputs.time.push_back(1e-3 * k);
    const double t = 1e-3 * (held ? k - k % 2 : k);
    reference.push_back(0.02 * std::pow(std::sin(1.5 * t), 3) + 0.01 * std::sin(5.0 * t));
  }
  const auto model = axis("");
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  std::vector<std::vector<double>> columns(4);
  for (std::size_t k = 0; k < inputs.rows(); k += 2) {
    columns[0].push_back(inputs.time[k]), columns[1].push_back(reference[k]);
    columns[2].push_back(out[0][k] + noise(random)), columns[3].push_back(out[1][k] + 4e3 * noise(random));
  }
  recording::Table table;
  table.file = "run.csv";
  table.add("t", "s", columns[0]);
  table.add("r", "m", columns[1]);
  table.add("y", "m", columns[2]);
  table.add("u", "A", columns[3]);
  return table;
}

Diagnosis diagnosed(Case& data) {
  return diagnose(data, [](double, const std::string&) {});
}

TEST(RowsAndCycles, AReferenceIsHeldFromRowToRow) {
  auto data = make_case(axis(""), {every_other_cycle(true)});
  const auto d = diagnosed(data);
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
  EXPECT_FALSE(data.model.reference_goes_on);
}

TEST(RowsAndCycles, AReferenceThatWentOnBetweenTheRowsIsSaidAndModelled) {
  auto data = make_case(axis(""), {every_other_cycle(false)});
  const auto d = diagnosed(data);
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
  EXPECT_TRUE(d.best.model.reference_goes_on.value_or(false));
  EXPECT_THAT(beside_the_verdict(data, d), HasSubstr("`hold: smooth`"));
}

TEST(RowsAndCycles, WhatTheFileSaysOfTheReferenceHolds) {
  auto data = make_case(axis(", hold: step"), {every_other_cycle(false)});
  (void)diagnosed(data);
  EXPECT_FALSE(data.model.reference_goes_on.value_or(true));
}

constexpr const char* store =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\n"
    "states: {x: {derivative: '5*(u - x)', initial: {value: 0, unit: V, sigma: 0}}}\n"
    "outputs: {x: {column: out, expression: x}}\nparameters: {}\nnoise: {x: 0.0005}\n";

/// Stamps off by up to a fifth of a step. `at_stamps`: the rows were taken when the stamps say, else at even steps.
recording::Table scattered(bool at_stamps) {
  constexpr unsigned seed = 6;
  std::cout << "seed " << seed << '\n';
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.0005};
  std::uniform_real_distribution<double> off{-0.2, 0.2}, level{-1.0, 1.0};
  const auto model = test::model_of(store);
  physics::Record inputs;
  auto& u = inputs.signals["u"];
  std::vector<double> stamps;
  for (int i = 0; i < 1200; ++i) {
    stamps.push_back(0.02 * (i + (i == 0 ? 0.0 : off(random))));
    inputs.time.push_back(at_stamps ? stamps.back() : 0.02 * i);
    u.push_back(i % 30 == 0 ? level(random) : u.back());
  }
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  for (double& v : out[0]) v += noise(random);
  recording::Table table;
  table.file = "run.csv";
  table.add("t", "s", stamps);
  table.add("in", "V", u);
  table.add("out", "V", out[0]);
  return table;
}

TEST(RowsAndCycles, StampsThatScatterAboutEvenStepsArePutBackOntoThem) {
  auto data = make_case(test::model_of(store), {scattered(false)});
  EXPECT_THAT(data.doubts, ::testing::ElementsAre(
                               HasSubstr("run.csv: column `t` scatters by 2.3 ms about even steps of 20")));
  EXPECT_EQ(diagnosed(data).verdict, Verdict::no_mismatch);
}

TEST(RowsAndCycles, RowsThatWereTakenWhenTheirStampsSayStayThere) {
  auto data = make_case(test::model_of(store), {scattered(true)});
  EXPECT_THAT(data.doubts, ::testing::IsEmpty());
  EXPECT_EQ(diagnosed(data).verdict, Verdict::no_mismatch);
}

}  // namespace
}  // namespace invar::diagnosis
