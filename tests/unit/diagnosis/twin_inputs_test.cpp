// Two inputs that run alike: which of the two acts cannot be known, and is said so. The machine is made here by its closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double step = 0.02, lag = 0.3, coupled = 0.4;

std::vector<double> levels(std::mt19937& random, double lower, double upper) {
  std::vector<double> values;
  while (values.size() < 2000)
    values.insert(values.end(), std::uniform_int_distribution<std::size_t>{20, 90}(random),
                  std::uniform_real_distribution<double>{lower, upper}(random));
  values.resize(2000);
  return values;
}

/// x' = (u - x) / lag + coupled * pump under levels, exactly from row to row. The fan is the pump, `apart` as a spread [V] off it.
Diagnosis diagnosis_of(double apart) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal;
  std::vector<double> time, x, fan;
  const auto u = levels(random, -8.0, 8.0), pump = levels(random, 0.0, 3.0);
  double state = 0.0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    time.push_back(step * static_cast<double>(i));
    x.push_back(state + 0.005 * normal(random));
    fan.push_back(pump[i] + apart * normal(random));
    const double end = u[i] + lag * coupled * pump[i];
    state = end + (state - end) * std::exp(-step / lag);
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "V", u);
  table.add("fan", "V", fan);
  table.add("pump", "V", pump);
  table.add("x", "V", x);
  auto data = make_case(
      test::model_of(
          "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {v: u, f: fan, p: pump}\n"
          "states: {s: {derivative: '(k*v - s)/T', initial: {value: 0, unit: V}}}\n"
          "outputs: {one: {column: x, expression: s}}\n"
          "parameters: {k: {value: 1, unit: 1, sigma: 0.001}, T: {value: 0.3, unit: s, sigma: 0.001}}\n"),
      {table});
  return diagnose(data, [](double, const std::string&) {});
}

TEST(TwinInputs, ShareTheProbabilityOfTheirCauseAndTheVerdictIsAmbiguous) {
  const auto d = diagnosis_of(0.0);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& finding = d.findings.front();
  EXPECT_EQ(finding.term.info->name, "coupling");
  EXPECT_NEAR(finding.term.values.front(), coupled, 0.01);
  EXPECT_EQ(d.verdict, Verdict::ambiguous);
  EXPECT_LE(finding.probability, 0.5);
  ASSERT_FALSE(finding.alternatives.empty());
  EXPECT_NE(finding.alternatives.front().term.with, finding.term.with);
}

TEST(TwinInputs, AreToldApartByASpreadThatOnlyOneOfThemHas) {
  const auto d = diagnosis_of(0.1);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings.front().term.info->name, "coupling");
  EXPECT_EQ(d.findings.front().term.with, "p");
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_GT(d.findings.front().probability, 0.9);
}

}  // namespace
}  // namespace invar::diagnosis
