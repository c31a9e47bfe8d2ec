// Machines that no name of the library describes: no name is claimed for them, and what is left is not called noise.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::diagnosis {
namespace {

constexpr double step = 0.005;
constexpr std::size_t rows = 2400;

physics::Model rigid_motor() {
  return test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
      "states: {w: {derivative: 'k*u - a*w', initial: {value: 0, unit: rad/s, sigma: 1}}}\n"
      "outputs: {speed: {column: speed, expression: w}}\n"
      "parameters: {k: {value: 12, unit: 1, sigma: 4}, a: {value: 3, unit: 1/s, sigma: 2}}\n");
}

/// Two inertias on an elastic shaft, the far one measured: what leaves `rigid_motor` ringing at 6 Hz.
recording::Table elastic_motor(unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.1};
  std::uniform_real_distribution<double> level{-6.0, 6.0};
  std::array<double, 3> x{};
  std::vector<double> time, volt, speed;
  double u = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % 60 == 0) u = level(random);
    time.push_back(step * static_cast<double>(i));
    volt.push_back(u);
    // A cell that nobody filled now and then: what is missing must not hide what is left over.
    speed.push_back(i % 50 == 7 ? std::nan("") : x[1] + noise(random));
    constexpr int parts = 100;
    for (int part = 0; part < parts; ++part) {  // small steps of Euler's rule, for a truth of its own
      const double torque = 900.0 * x[2] + 1.2 * (x[0] - x[1]), h = step / parts;
      x = {x[0] + h * (20.0 * u - 4.0 * x[0] - torque), x[1] + h * (torque - 0.5 * x[1]) / 0.6,
           x[2] + h * (x[0] - x[1])};
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("volt", "V", volt);
  table.add("speed", "rad/s", speed);
  return table;
}

TEST(WithoutAName, AnElasticShaftIsNeitherNoiseNorADelay) {
  testing::TemporaryFolder folder;
  elastic_motor(3).write(folder / "recording.csv");
  auto data = load_case(rigid_motor(), {folder / "recording.csv"});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_TRUE(d.verdict == Verdict::unknown_physics || d.verdict == Verdict::partly_explained)
      << name_of(d.verdict);
  EXPECT_GT(d.unexplained, 2.0);
  for (const auto& finding : d.findings)
    EXPECT_TRUE(finding.term.info->name == "unmodelled" || finding.probability < 0.5)
        << finding.term.info->name;
  const auto report = nlohmann::json::parse(report_json(data, d));
  for (const auto& finding : report["findings"])
    if (finding.contains("stand_in")) {
      EXPECT_EQ(finding["term"], "unmodelled");
      EXPECT_TRUE(finding["parameters"].empty());
      EXPECT_FALSE(report["location"].empty());
    }
}

TEST(WithoutAName, WhatIsLeftFarAboveTheNoiseIsSeenBesideMissingValues) {
  testing::TemporaryFolder folder;
  elastic_motor(4).write(folder / "recording.csv");
  auto data = load_case(rigid_motor(), {folder / "recording.csv"});
  const auto weighing = weigh(data, simulate(data, data.model), Colour::white);
  const auto rigid = fit(data, weighing, data.model, data.model, Effort::follow(12));
  EXPECT_GT(far_share(data, rigid, 3.0).front(), 0.8);
  EXPECT_GT(followed_share(data, rigid).front(), 0.05);
}

/// What `rate` makes of a motor's speed from its voltage and the time, in small steps of Euler's rule.
recording::Table motor(unsigned seed, const std::function<double(double u, double w, double t)>& rate) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.05};
  std::uniform_real_distribution<double> level{-6.0, 6.0};
  std::vector<double> time, volt, speed;
  double u = 0.0, w = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % 60 == 0) u = level(random);
    time.push_back(step * static_cast<double>(i));
    volt.push_back(u);
    speed.push_back(w + noise(random));
    for (int part = 0; part < 100; ++part) w += 0.01 * step * rate(u, w, time.back() + 0.01 * step * part);
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("volt", "V", volt);
  table.add("speed", "rad/s", speed);
  return table;
}

TEST(WithoutAName, ANumberThatChangesOnTheWayIsACourseInProportionToItsState) {
  // The bearing warms: less damping from the fifth second on.
  auto data = make_case(
      rigid_motor(),
      {motor(6, [](double u, double w, double t) { return 12.0 * u - (t < 5.0 ? 3.0 : 2.7) * w; })});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics) << summary(data, d);
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.curve.over, "t");
  EXPECT_EQ(d.findings[0].term.with, "w");
  EXPECT_LT(d.heldout[0].after, 0.7 * d.heldout[0].retuned);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("goes with t and w"));
}

TEST(WithoutAName, TheSameNumbersFromBeginningToEndAreNoSuchCourse) {
  for (const unsigned seed : {7U, 8U, 9U}) {
    auto data = make_case(rigid_motor(),
                          {motor(seed, [](double u, double w, double) { return 12.0 * u - 3.0 * w; })});
    EXPECT_TRUE(diagnose(data, [](double, const std::string&) {}).findings.empty()) << seed;
  }
}

std::string fault_of(const std::function<void(recording::Table&)>& spoil) {
  testing::TemporaryFolder folder;
  auto table = elastic_motor(5);
  spoil(table);
  table.write(folder / "recording.csv");
  try {
    const auto data = load_case(rigid_motor(), {folder / "recording.csv"});
    check_runs(data, data.model, 0.5, "model.yaml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(Recording, ThatSaysNothingIsRefused) {
  using ::testing::HasSubstr;
  EXPECT_EQ(fault_of([](recording::Table&) {}), "none");
  EXPECT_THAT(fault_of([](auto& t) { t.columns[2].values.assign(rows, std::nan("")); }),
              HasSubstr("column `speed`: has no number"));
  EXPECT_THAT(fault_of([](auto& t) { t.columns[2].values.assign(rows, 1e300); }), HasSubstr("has no number"));
  EXPECT_THAT(fault_of([](auto& t) { t.columns[1].values.assign(rows, std::nan("")); }),
              HasSubstr("column `volt`: has no number"));
  EXPECT_THAT(fault_of([](auto& t) {
                for (double& v : t.columns[0].values) v = -v;
              }),
              HasSubstr("goes back at most of its rows"));
}

/// Two tanks in a row, exactly solved where the pump is held; the instrument at the second one drifts.
Case drifting(double drift) {
  std::mt19937 random{6};
  std::normal_distribution<double> noise{0.0, 0.004};
  recording::Table table;
  std::vector<double> t, u, first, second;
  constexpr double apart = 0.1, a = 0.5, b = 0.2;
  double x = 0.0, z = 0.0;
  for (int k = 0; k < 1200; ++k) {
    t.push_back(apart * k), u.push_back((k / 170) % 2 == 0 ? 1.0 : 0.3);
    first.push_back(x + noise(random)), second.push_back(z + drift * t.back() + noise(random));
    const double aim = u.back() / a, fall = x - aim, kept_x = std::exp(-a * apart),
                 kept_z = std::exp(-b * apart);
    // z' = a x - b z with x = aim + fall exp(-a t)
    const double steady = a * aim / b, passing = a * fall / (b - a);
    z = steady + passing * kept_x + (z - steady - passing) * kept_z;
    x = aim + fall * kept_x;
  }
  table.add("t", "s", t);
  table.add("u", "1", u);
  table.add("h1", "m", first);
  table.add("h2", "m", second);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                     "states:\n  x: {derivative: 'u - a*x', initial: {value: 0, unit: m, sigma: 0}}\n"
                     "  z: {derivative: 'a*x - b*z', initial: {value: 0, unit: m, sigma: 0}}\n"
                     "outputs: {upper: {column: h1, expression: x}, lower: {column: h2, expression: z}}\n"
                     "parameters: {a: {value: 0.51, sigma: 0.02}, b: {value: 0.205, sigma: 0.01}}\n"),
      {table});
}

TEST(Unnamed, AnInstrumentThatDriftsIsNoPhysicsOfTheMachine) {
  auto data = drifting(0.002);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(site_of(data, term), "equations.output");
  EXPECT_EQ(place_of(data, term), "output lower");
  EXPECT_EQ(unit_of_curve(data, term), "m");
  EXPECT_EQ(term.curve.over, "t");
  EXPECT_NEAR(term.curve(100.0) - term.curve(20.0), 0.16, 0.01);
  EXPECT_NEAR(d.best.model.value("b"), 0.2, 0.002);
}

}  // namespace
}  // namespace invar::diagnosis
