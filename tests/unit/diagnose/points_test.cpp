// Error maps whose truth is written out here: a play that nobody recorded the direction of.
#include <gmock/gmock.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/support/model_of.hpp"
#include "tools/diagnose/search.hpp"

namespace invar::diagnose {
namespace {

constexpr double travel = 0.2, noise = 2e-7;

physics::Model straight_axis() {
  return test::model_of(
      "invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, error: e}\n"
      "baseline: {positions: [0, 0.05, 0.1, 0.15, 0.2], errors: [0, 0, 0, 0, 0]}\n"
      "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0.1}}\nterms: []\n");
}

/// A calibration there and back, the end points read twice; `play` [m] between the ways.
Case calibrated(double play, bool back, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, noise};
  std::vector<double> time, position, error;
  constexpr int points = 25;
  for (int k = 0; k < 8 * points; ++k) {
    const int at = k % points;
    const bool up = !back || (k / points) % 2 == 0;
    time.push_back(5.0 * k);
    position.push_back(travel * (up ? at : points - 1 - at) / (points - 1));
    error.push_back((up ? 0.5 : -0.5) * play + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("e", "m", error);
  return make_case(straight_axis(), {table});
}

TEST(ErrorMaps, PlayIsFoundThoughNobodyRecordedTheDirection) {
  auto data = calibrated(8e-7, true, 11);
  const auto d = search(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "backlash");
  EXPECT_NEAR(d.findings[0].term.values[0], 8e-7, 1e-7);
  EXPECT_EQ(d.verdict, Verdict::explained);
}

TEST(ErrorMaps, AConstantIsNoPlayWhereAllPointsWereApproachedFromOneSide) {
  auto data = calibrated(8e-7, false, 12);
  const auto d = search(data, [](double, const std::string&) {});
  for (const auto& finding : d.findings) EXPECT_NE(finding.term.info->name, "backlash");
}

}  // namespace
}  // namespace invar::diagnose
