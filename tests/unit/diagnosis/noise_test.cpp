// Noise is what an instrument adds: what more is left is mismatch, whatever its colour.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tools/diagnose/report_page.hpp"

namespace invar::diagnosis {
namespace {

constexpr std::size_t rows = 3000;
constexpr double white = 1e-6;  // [m]

physics::Model encoder(const std::string& noise = "") {
  return test::model_of(
      "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: laser, encoder: encoder}\n"
      "parameters: {resolution: {value: 0, unit: m, sigma: 0}}\n" +
      noise);
}

/// A carriage that goes to and fro; the encoder reads it with white noise and a wander that nobody recorded.
recording::Table readings(double wander, unsigned seed = 5) {
  std::mt19937 random{seed};
  std::normal_distribution<double> unit;
  std::vector<double> time, laser, read;
  double drift = 0.0;
  constexpr double kept = 0.98;  // from row to row
  for (std::size_t i = 0; i < rows; ++i) {
    drift = kept * drift + std::sqrt(1.0 - kept * kept) * wander * unit(random);
    time.push_back(0.001 * static_cast<double>(i));
    laser.push_back(0.05 * std::sin(2.0 * std::numbers::pi * 0.7 * time.back()));
    read.push_back(laser.back() + drift + white * unit(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("laser", "m", laser);
  table.add("encoder", "m", read);
  return table;
}

double noise_of(const Case& data) { return instrument_noise(data, simulate(data, data.model), 0); }

TEST(InstrumentNoise, IsWhatNeighbouringRowsSayWhateverWandersBeside) {
  EXPECT_NEAR(noise_of(make_case(encoder(), {readings(0.0)})), white, 0.1 * white);
  EXPECT_LT(noise_of(make_case(encoder(), {readings(12.0 * white)})), 2.0 * white);
}

/// A level behind an outlet, read with white noise that grows with it.
TEST(InstrumentNoise, ThatGrowsWithTheReadingIsNoPhysics) {
  std::mt19937 random{3};
  std::normal_distribution<double> unit;
  std::uniform_real_distribution<double> any{0.2, 1.6};
  std::vector<double> time, inflow, level;
  double h = 0.5, u = 1.0;
  for (int i = 0; i < 1500; ++i) {
    if (i % 60 == 0) u = any(random);
    time.push_back(i), inflow.push_back(u),
        level.push_back(h * (1.0 + 0.01 * unit(random)) + 0.002 * unit(random));
    for (int part = 0; part < 20; ++part) h += 0.05 * (0.05 * u - 0.04 * std::sqrt(h));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("q", "1", inflow);
  table.add("h", "m", level);
  auto data = make_case(
      test::model_of(
          "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: q}\n"
          "states: {x: {derivative: 'a*u - b*sqrt(x)', initial: {value: 0.5, unit: m, sigma: 0.05}}}\n"
          "outputs: {level: {column: h, expression: x}}\n"
          "parameters: {a: {value: 0.05, unit: 1, sigma: 0.005}, b: {value: 0.04, unit: 1, sigma: 0.004}}\n"),
      {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch) << summary(data, d);
}

TEST(InstrumentNoise, IsWhatTheModelSays) {
  EXPECT_DOUBLE_EQ(noise_of(make_case(encoder("noise: {encoder: 3.0e-6}\n"), {readings(0.0)})), 3e-6);
}

TEST(InstrumentNoise, IsNoLessThanTheStepInWhichAConverterCounts) {
  auto table = readings(0.0);
  constexpr double step = 2e-4;
  for (auto& column : table.columns)
    if (column.name == "encoder")
      for (double& v : column.values) v = step * std::round(v / step);
  EXPECT_GE(noise_of(make_case(encoder(), {table})), 0.99 * step / std::sqrt(12.0));
}

TEST(Verdict, WhatWandersFarAboveTheNoiseIsNeverNothing) {
  for (const unsigned seed : {5U, 6U, 7U}) {
    auto data = make_case(encoder(), {readings(12.0 * white, seed)});
    const auto d = diagnose(data, [](double, const std::string&) {});
    SCOPED_TRACE(summary(data, d));
    EXPECT_GT(most_over_noise(d), thresholds::times_noise);
    EXPECT_NE(d.verdict, Verdict::no_mismatch);
    EXPECT_NE(d.verdict, Verdict::parameters_only);
    EXPECT_NE(d.verdict, Verdict::explained);
    EXPECT_THAT(page_text(data, d, ""),
                ::testing::Not(::testing::HasSubstr("nothing that this recording shows")));
  }
}

TEST(Verdict, WhiteNoiseAloneIsNoMismatch) {
  auto data = make_case(encoder(), {readings(0.0)});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch) << summary(data, d);
  EXPECT_LT(most_over_noise(d), 1.2);
}

/// An instrument of velocity beside true positions whose stamps hiccup once: a late row, then five in a hurry.
recording::Table hurried(bool hurries) {
  std::mt19937 random{11};
  std::normal_distribution<double> unit;
  std::vector<double> time, truth, speed;
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = 0.001 * static_cast<double>(i);
    truth.push_back(std::sin(2.0 * std::numbers::pi * 1.5 * t));
    speed.push_back(2.0 * std::numbers::pi * 1.5 * std::cos(2.0 * std::numbers::pi * 1.5 * t) +
                    0.05 * unit(random));
    time.push_back(t);
  }
  if (hurries)
    for (std::size_t k = 0; k < 5; ++k) time[640 + k] = 0.64445 + 1e-4 * static_cast<double>(k);
  recording::Table table;
  table.add("t", "s", time);
  table.add("angle", "m", truth);
  table.add("speed", "m/s", speed);
  return table;
}

TEST(Verdict, AFewRowsWithFalseStampsCarryNoFit) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: angle, velocity_sensor: speed}\n"
      "parameters: {gain: {value: 1.0, unit: 1, sigma: 0.02}}\n");
  for (const bool hurries : {false, true}) {
    auto data = make_case(model, {hurried(hurries)});
    const auto d = diagnose(data, [](double, const std::string&) {});
    SCOPED_TRACE(summary(data, d));
    EXPECT_EQ(d.verdict, Verdict::no_mismatch);
    EXPECT_NEAR(d.retuned.model.value("gain"), 1.0, 0.01);
    EXPECT_EQ(data.doubts.empty(), !hurries);
  }
}

}  // namespace
}  // namespace invar::diagnosis
