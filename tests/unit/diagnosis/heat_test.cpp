// The diagnosis of heated bodies against networks made here: other sizes than any recording at hand.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// What a body feels, for so long.
struct Moment {
  double temperature, speed, power, step;
  double& store;
};

/// A body of `capacity` [J/K] that loses `loss` [W/K] to air of 22 degC, heated in random steps up to `most` [W]; `more`
/// gives what else flows into it [W] and advances a store of its own. A stage beside it moves at 0, 0.25 ... 1 m/s.
Case heated(double capacity, double loss, double most, double noise,
            const std::function<double(const Moment&)>& more) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal{0.0, noise};
  std::uniform_real_distribution<double> uniform{0.0, most};
  const double row = 0.04 * capacity / loss;
  constexpr int parts = 50;
  std::vector<double> time, power, reading, speeds;
  double body = 22.0, store = 22.0, now = 0.0;
  for (int i = 0; i < 1600; ++i) {
    if (i % 80 == 0) now = (i / 80) % 3 == 2 ? 0.0 : uniform(random);
    speeds.push_back(0.25 * static_cast<double>((i / 50) % 5));
    time.push_back(row * i), power.push_back(now), reading.push_back(body + normal(random));
    for (int part = 0; part < parts; ++part) {
      const double step = row / parts;
      const double flow = more({body, speeds.back(), now, step, store});
      body += step * (now + flow - loss * (body - 22.0)) / capacity;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("P", "W", power);
  table.add("T", "degC", reading);
  table.add("v", "m/s", speeds);
  const auto text = [](double v) { return std::to_string(v); };
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: thermal\ncolumns: {time: t, speed: v}\nnodes:\n  body: {column: T, "
          "capacity: {value: " +
          text(capacity) + ", unit: J/K, sigma: " + text(0.04 * capacity) +
          "}, loss: {value: " + text(0.97 * loss) + ", unit: W/K, sigma: " + text(0.1 * loss) +
          "}}\nheaters:\n  pad: {node: body, column: P, gain: {value: 1, unit: W/W, sigma: "
          "0.01}}\nambient: {value: 22.2, unit: degC, sigma: 0.4}\nnoise: {T: " +
          text(noise) + "}\n"),
      {table});
}

TEST(Heat, AStoreBehindAWeakContactIsAStore) {
  // It takes half a percent of what the air takes, and fills no faster than the recording lasts: much as if the air grew warm.
  auto data = heated(10400.0, 32.0, 1000.0, 0.005, [](const Moment& at) {
    const double flow = 0.16 * (at.temperature - at.store);
    at.store += at.step * flow / 3000.0;
    return -flow;
  });
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "hidden_node");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.16, 0.02);
  EXPECT_NEAR(d.findings[0].term.values[1], 3000.0, 600.0);
}

TEST(Heat, CountsOfACoarseThermometerAreNoPhysics) {
  auto data = heated(400.0, 1.3, 60.0, 0.01, [](const Moment&) { return 0.0; });
  data.given_noise[0] = std::nan("");
  for (double& v : data.recordings[0].measured[0]) v = 0.1 * std::round(10.0 * v);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_TRUE(d.findings.empty()) << summary(data, d);
  EXPECT_NE(d.verdict, Verdict::unknown_physics) << summary(data, d);
}

TEST(Heat, AirThatIsDrivenCarriesHeatAwayWithAPowerOfTheSpeed) {
  auto data = heated(2000.0, 10.0, 300.0, 0.02, [](const Moment& at) {
    return -1.5 * std::pow(at.speed, 0.7) * (at.temperature - 22.0);
  });
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_EQ(d.findings[0].stand_in, nullptr);
  EXPECT_EQ(d.findings[0].term.info->name, "speed_dependent_convection");
  const auto& values = d.findings[0].term.values;
  EXPECT_NEAR(values[1], 0.7, 0.03);
  EXPECT_NEAR(values[0] * std::pow(values[2], 0.3), 1.5, 0.05);
}

TEST(Heat, WhatMeltsIsStoredAtItsTemperature) {
  // 400 J/K more between 34 and 36 degC: wax in a body of 2000 J/K.
  auto data = heated(2000.0, 10.0, 300.0, 0.01, [](const Moment& at) {
    const bool melts = at.temperature > 34.0 && at.temperature < 36.0;
    return melts ? (1.0 / (1.0 + 0.2) - 1.0) * (at.power - 10.0 * (at.temperature - 22.0)) : 0.0;
  });
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics) << summary(data, d);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.info->site, "storage");
  EXPECT_EQ(term.curve.over, "temperature");
  EXPECT_GT(term.curve(35.0) - term.curve(30.0), 200.0);
  EXPECT_GT(term.curve(35.0) - term.curve(40.0), 200.0);
}

/// A body as it is believed, with `spoil` done to what is recorded of it.
Case as_believed(const std::function<void(recording::Table&)>& spoil, double start = 22.0) {
  std::mt19937 random{12};
  std::normal_distribution<double> normal{0.0, 0.01};
  std::vector<double> time, power, reading;
  double body = start;
  for (int i = 0; i < 600; ++i) {
    time.push_back(2.0 * i), power.push_back((i / 80) % 2 == 0 ? 10.0 + 0.1 * (i % 80) : 60.0);
    reading.push_back(body + normal(random));
    const double settled = 22.0 + power.back() / 8.0;  // the exact step of a power that is held
    body = settled + (body - settled) * std::exp(-2.0 * 8.0 / 800.0);
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("P", "W", power);
  table.add("T", "degC", reading);
  spoil(table);
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: thermal\ncolumns: {time: t}\nnodes:\n  body: {column: T, "
          "capacity: {value: 800, unit: J/K, sigma: 20}, loss: {value: 8, unit: W/K, sigma: 0.3}}\n"
          "heaters:\n  pad: {node: body, column: P, gain: {value: 1, unit: W/W, sigma: 0.01}}\n"
          "ambient: {value: 22, unit: degC, sigma: 0}\nnoise: {T: 0.01}\n"),
      {table});
}

TEST(Heat, ANumberThatTheMachineDidNotFeelIsASlipOfTheRecord) {
  auto data = as_believed([](recording::Table& table) { table.columns[1].values[400] = 99999.0; });
  EXPECT_EQ(data.count.lone_inputs, 1U);
  EXPECT_TRUE(std::isnan(data.recordings[0].inputs.signals.at("pad")[400]));
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_TRUE(d.findings.empty()) << summary(data, d);
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
}

TEST(Heat, ABlowOfOneRowThatTheMachineFeltIsNone) {
  // 500 W for 2 s in a body of 800 J/K: 1.25 K.
  auto data = as_believed([](recording::Table& table) {
    table.columns[1].values[100] += 500.0;
    for (std::size_t i = 101; i < 600; ++i)
      table.columns[2].values[i] +=
          500.0 / 8.0 * -std::expm1(-0.02) * std::exp(-0.02 * static_cast<double>(i - 101));
  });
  EXPECT_EQ(data.count.lone_inputs, 0U);
  EXPECT_TRUE(diagnose(data, [](double, const std::string&) {}).findings.empty());
}

TEST(Heat, AStartOffTheAirIsSeenThoughOneReadingSlips) {
  for (const double start : {22.2, 22.36}) {
    auto data = as_believed([](recording::Table& table) { table.columns[2].values[2] += 0.5; }, start);
    const auto& given = data.recordings[0].inputs.signals.at("body");
    EXPECT_NEAR(given[0], start, 0.03);
    const auto d = diagnose(data, [](double, const std::string&) {});
    EXPECT_EQ(d.verdict, Verdict::no_mismatch) << start << summary(data, d);
  }
}

TEST(Heat, AHeaterThatOneStepAloneDrivesTooFarSaturates) {
  constexpr double most = 33.9;
  double top = 0.0;
  auto data = heated(70.0, 1.7, 36.0, 0.004, [&](const Moment& at) {
    top = std::max(top, at.power);
    return -std::max(0.0, at.power - most);
  });
  EXPECT_GT(top, most);
  EXPECT_LT(top, 1.02 * most);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "heater_saturation");
  EXPECT_NEAR(d.findings[0].term.values[0], most, 0.02);
}

}  // namespace
}  // namespace invar::diagnosis
