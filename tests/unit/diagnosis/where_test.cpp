// Where an effect acts in models that remember: over the variable of the term itself, under the names that the user knows.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/region.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using ::testing::ElementsAre;

Diagnosis claimed(const Case& data, const char* name, const char* on, const char* with,
                  std::initializer_list<double> values) {
  Diagnosis d;
  physics::Term term;
  term.info = physics::find_term(data.model.plant, name);
  term.on = on, term.with = with;
  std::copy(values.begin(), values.end(), term.values.begin());
  d.best.model = data.model;
  d.best.model.terms.push_back(term);
  d.findings.emplace_back().term = term;
  return d;
}

Case vessels() {
  std::vector<double> time, flow, level;
  for (int i = 0; i <= 1000; ++i) {
    time.push_back(0.1 * i);
    flow.push_back(1.0 - std::cos(2.0 * 3.14159265358979 * 0.02 * time.back()));
    level.push_back(flow.back());
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("pump", "", flow);
  table.add("level_2", "", level);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {Q: pump}\nstates:\n"
                     "  H1: {derivative: '10*(Q - H1)', initial: {value: 0, sigma: 0}}\n"
                     "  H2: {derivative: '10*(H1 - H2)', initial: {value: 0, sigma: 0}}\n"
                     "outputs: {h2: {column: level_2, expression: H2}}\nparameters: {}\n"),
      {table});
}

TEST(Where, AVariableOfOwnEquationsBearsItsColumnToo) {
  const auto data = vessels();
  EXPECT_THAT(recorded_as(data, "Q"), ElementsAre("pump"));
  EXPECT_THAT(recorded_as(data, "H2"), ElementsAre("h2", "level_2"));
  EXPECT_THAT(recorded_as(data, "H1"), ElementsAre());
  EXPECT_THAT(recorded_as(data, "t"), ElementsAre("time"));
  // What runs over goes with the vessel that is full, wherever it arrives.
  EXPECT_THAT(dependence(data, claimed(data, "overflow", "H1", "H2", {1.5, 1.0}).findings[0]),
              ElementsAre("H1", "H2"));
}

/// Two vessels in a row of which the second is read; a steady inflow into the first shows as one into the second.
TEST(Where, ASteadyRateThatMayActAtTwoStatesIsExplainedAndBothAreSaid) {
  std::mt19937 random{7};
  std::normal_distribution<double> noise{0.0, 0.002};
  std::vector<double> time, pump, level;
  double a = 0.5, b = 0.5, u = 0.5;
  for (int i = 0; i < 900; ++i) {
    if (i % 40 == 0) u = std::uniform_real_distribution<double>{0.2, 1.0}(random);
    time.push_back(0.1 * i), pump.push_back(u), level.push_back(b + noise(random));
    for (int part = 0; part < 100; ++part) {
      a += 1e-3 * (u - a + 0.01);
      b += 1e-3 * (a - b);
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "", pump);
  table.add("y", "", level);
  auto data = make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\nstates:\n"
                     "  a: {derivative: 'k*(u - a)', initial: {value: 0.5, sigma: 0.02}}\n"
                     "  b: {derivative: 'k*(a - b)', initial: {value: 0.5, sigma: 0.02}}\n"
                     "outputs: {y: {column: y, expression: b}}\nnoise: {y: 0.002}\n"
                     "parameters: {k: {value: 1, sigma: 0.02}}\n"),
      {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::explained) << summary(data, d);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "constant");
  const auto report = nlohmann::json::parse(report_json(data, d));
  std::set<std::string> sites;
  for (const auto& place : report["location"]) sites.insert(place["site"]);
  EXPECT_THAT(sites, ElementsAre("equations.a", "equations.b"));
  EXPECT_EQ(report["ambiguity"].size(), 1U);
}

TEST(Where, ALimitActsBeyondIt) {
  const auto data = vessels();
  const auto of_input = regions_of(data, claimed(data, "upper_limit", "Q", "", {1.5}), 0);
  ASSERT_EQ(of_input.size(), 1U);
  EXPECT_EQ(of_input[0].variable, "Q");
  EXPECT_NEAR(of_input[0].within.lower, 1.5, 0.06);
  EXPECT_NEAR(of_input[0].within.upper, 2.0, 1e-9);
  EXPECT_TRUE(of_input[0].is_part);
  const auto of_state = regions_of(data, claimed(data, "lower_limit", "H1", "", {0.4}), 0);
  ASSERT_EQ(of_state.size(), 1U);
  EXPECT_NEAR(of_state[0].within.upper, 0.4, 0.06);
  EXPECT_TRUE(regions_of(data, claimed(data, "lag", "Q", "", {1.5}), 0).empty());
}

TEST(Where, AHeaterSaturatesAboveItsPower) {
  std::vector<double> time, power, slide;
  for (int i = 0; i <= 400; ++i) {
    time.push_back(i);
    power.push_back(0.25 * i);
    slide.push_back(20.0 + 0.1 * i);
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("P", "W", power);
  table.add("T", "degC", slide);
  const auto data = make_case(
      test::model_of("invar_model: 1\nplant: thermal\ncolumns: {time: t}\nnodes:\n  slide: {column: T, "
                     "capacity: {value: 850, unit: J/K}, loss: {value: 9, unit: W/K}}\nheaters:\n  pad: "
                     "{node: slide, column: P, gain: {value: 1, unit: W/W}}\nambient: {value: 20, unit: "
                     "degC}\n"),
      {table});
  const auto regions = regions_of(data, claimed(data, "heater_saturation", "slide", "", {40.0}), 0);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_EQ(regions[0].variable, "power");
  // A third of the most, 20 W of 60 W, is lost at 60 W.
  EXPECT_NEAR(regions[0].within.lower, 60.0, 3.0);
  EXPECT_NEAR(regions[0].within.upper, 100.0, 1e-9);
  EXPECT_TRUE(regions_of(data, claimed(data, "hidden_node", "slide", "", {1.0, 300.0}), 0).empty());
}

}  // namespace
}  // namespace invar::diagnosis
