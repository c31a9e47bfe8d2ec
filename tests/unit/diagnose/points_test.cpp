// Error maps and drops whose truth is written out here, point by point.
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

/// A calibration there and back, the end points read twice; `play` [m] between the ways, around `middle` [m].
Case calibrated(double play, bool back, unsigned seed, double middle = 0.0) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, noise};
  std::vector<double> time, position, error;
  constexpr int points = 25;
  for (int k = 0; k < 8 * points; ++k) {
    const int at = k % points;
    const bool up = !back || (k / points) % 2 == 0;
    time.push_back(5.0 * k);
    position.push_back(travel * (up ? at : points - 1 - at) / (points - 1));
    error.push_back(middle + (up ? 0.5 : -0.5) * play + reading(random));
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

TEST(ErrorMaps, PlayBesideABaselineThatWasTakenFromOneSideLeavesNothingElse) {
  auto data = calibrated(8e-7, true, 13, -4e-7);
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

/// Two days of points all over the travel; the shop warms and cools by 2 K. `error` of time [s] and warmth [K].
template <class Error>
Case watched(Error error, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, noise};
  std::uniform_real_distribution<double> place{0.0, travel};
  std::vector<double> time, position, temperature, errors;
  for (int k = 0; k < 400; ++k) {
    const double t = 432.0 * k, warmth = 2.0 * std::sin(2.0 * M_PI * t / 50000.0);
    time.push_back(t), position.push_back(place(random)), temperature.push_back(20.0 + warmth);
    errors.push_back(error(t, warmth) + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("T", "degC", temperature);
  table.add("e", "m", errors);
  auto model = test::model_of(
      "invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, temperature: T, error: e}\n"
      "baseline: {positions: [0, 0.05, 0.1, 0.15, 0.2], errors: [0, 0, 0, 0, 0]}\n"
      "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0.1}}\nterms: []\n");
  return make_case(std::move(model), {table});
}

TEST(ErrorMaps, AScaleThatSlipsOnceIsDrawnAsAJump) {
  auto data = watched([](double t, double) { return t > 70000.0 ? 5e-7 : 0.0; }, 14);
  const auto d = search(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.best.model.terms.back().curve;
  EXPECT_EQ(curve.over, "time");
  EXPECT_NEAR(curve(71000.0) - curve(69000.0), 5e-7, 1e-7);
}

TEST(ErrorMaps, AnErrorThatGoesWithTheTemperatureAndNotWithThePlaceIsLocatedThere) {
  auto data = watched([](double, double warmth) { return 4e-7 * warmth; }, 15);
  const auto d = search(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.best.model.terms.back().curve.over, "temperature");
  EXPECT_EQ(d.best.model.terms.back().info->site, "kinematic");  // not in proportion to the position
}

TEST(Drops, WhatMovesThemInTwoDirectionsIsDrawnInBoth) {
  std::mt19937 random{16};
  std::normal_distribution<double> landing{0.0, 1e-5};
  std::uniform_real_distribution<double> place{-0.04, 0.04}, height{0.003, 0.02}, length{2e-4, 4e-4};
  std::vector<std::vector<double>> columns(7);
  for (int k = 0; k < 250; ++k) {
    const double x = place(random), y = place(random), on = length(random);
    const double push = 0.3 * (on - 3e-4);  // a longer pulse, a drop further out
    const double values[] = {
        2.0 * k, x, y, height(random), on, x + push + landing(random), y - 0.7 * push + landing(random)};
    for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(values[c]);
  }
  recording::Table table;
  const char* names[] = {"time", "target_x", "target_y", "height", "on_time", "landed_x", "landed_y"};
  for (std::size_t c = 0; c < columns.size(); ++c)
    table.add(names[c], c == 0 || c == 4 ? "s" : "m", columns[c]);
  auto data = make_case(
      test::model_of("invar_model: 1\nplant: droplet\n"
                     "columns: {time: time, target_x: target_x, target_y: target_y, height: height, on_time: "
                     "on_time, landed_x: landed_x, landed_y: landed_y}\n"
                     "parameters: {placement_error_x: {value: 0, unit: m, sigma: 2e-5}, placement_error_y: "
                     "{value: 0, unit: m, sigma: 2e-5}, slope_x: {value: 0, sigma: 0.002}, slope_y: {value: "
                     "0, sigma: 0.002}, speed: {value: 3, unit: m/s, sigma: 0.2}}\nterms: []\n"),
      {table});
  const auto d = search(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 2U);
  for (const auto& finding : d.findings) {
    EXPECT_EQ(finding.term.curve.over, "on_time");
    const double gone = finding.term.curve(3.8e-4) - finding.term.curve(2.2e-4);
    EXPECT_NEAR(gone, finding.term.on == "landed_x" ? 4.8e-5 : -3.36e-5, 6e-6);
  }
}

}  // namespace
}  // namespace invar::diagnose
