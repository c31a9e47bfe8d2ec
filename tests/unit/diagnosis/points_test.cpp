// Error maps, drops and instruments whose truth is written out here, point by point.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/wander.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tools/diagnose/report_page.hpp"

namespace invar::diagnosis {
namespace {

constexpr double travel = 0.2, noise = 2e-7;

physics::Model straight_axis(const std::string& more_columns = "") {
  return test::model_of(
      "invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, error: e" + more_columns +
      "}\n"
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
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "backlash");
  EXPECT_NEAR(d.findings[0].term.values[0], 8e-7, 1e-7);
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_THAT(page_text(data, d, "calibration"), ::testing::HasSubstr("by the side of approach"));
}

TEST(ErrorMaps, PlayBesideABaselineThatWasTakenFromOneSideLeavesNothingElse) {
  auto data = calibrated(8e-7, true, 13, -4e-7);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "backlash");
  EXPECT_NEAR(d.findings[0].term.values[0], 8e-7, 1e-7);
  EXPECT_EQ(d.verdict, Verdict::explained);
}

TEST(ErrorMaps, AConstantIsNoPlayWhereAllPointsWereApproachedFromOneSide) {
  auto data = calibrated(8e-7, false, 12);
  const auto d = diagnose(data, [](double, const std::string&) {});
  for (const auto& finding : d.findings) EXPECT_NE(finding.term.info->name, "backlash");
}

TEST(ErrorMaps, ABendBesideOneOffsetIsNoTilt) {
  const auto level = calibrated(0.0, true, 25);
  const auto& recording = level.recordings.front();
  const auto& at = *recording.inputs.find("position");
  auto error = recording.measured.front();
  for (std::size_t i = 0; i < at.size(); ++i) error[i] += 8e-6 * std::sin(M_PI * at[i] / travel);
  recording::Table table;
  table.add("t", "s", recording.inputs.time);
  table.add("x", "m", at);
  table.add("e", "m", error);
  table.add("beside", "m", std::vector<double>(at.size(), 0.044));
  auto data = make_case(straight_axis(", offset: beside"), {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_FALSE(d.findings.empty());
  EXPECT_EQ(d.findings[0].term.info->name, "sag");
  EXPECT_NEAR(std::abs(d.findings[0].term.values[0]), 8e-6, 1e-6);  // a parabola, not a sine
  for (const auto& finding : d.findings) EXPECT_NE(finding.term.info->name, "abbe_offset");
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
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.best.model.terms.back().curve;
  EXPECT_EQ(curve.over, "time");
  EXPECT_NEAR(curve(71000.0) - curve(69000.0), 5e-7, 1e-7);
}

TEST(ErrorMaps, AnErrorThatGoesWithTheTemperatureAndNotWithThePlaceIsLocatedThere) {
  auto data = watched([](double, double warmth) { return 4e-7 * warmth; }, 15);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.best.model.terms.back().curve.over, "temperature");
  EXPECT_EQ(d.best.model.terms.back().info->site, "kinematic");  // not in proportion to the position
}

TEST(ErrorMaps, AHumOverManyPointsIsDrawnAsAWaveInTime) {
  constexpr double period = 23000.0;
  auto data = watched([](double t, double) { return 4e-7 * std::sin(2.0 * M_PI * t / period + 0.4); }, 24);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.best.model.terms.back().curve;
  EXPECT_EQ(curve.over, "time");
  EXPECT_NEAR(curve.period, period, 0.02 * period);
  for (const double t : {1e4, 9e4, 1.7e5})
    EXPECT_NEAR(curve(t), 4e-7 * std::sin(2.0 * M_PI * t / period + 0.4), 1.2e-7);
}

/// A carriage that is swept there and back for an hour, 1 s a row; the air warms at once by 2 K now and then.
template <class Error>
Case swept(const std::string& more_columns, const std::string& expansion, Error error, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, noise};
  std::vector<std::vector<double>> columns(5);
  double scale = 0.0;  // [K], what follows the air
  for (int k = 0; k < 3600; ++k) {
    const double at = std::fmod(k / 400.0, 2.0), x = travel * (at < 1.0 ? at : 2.0 - at) - 0.1;
    const double air = (k / 600) % 2 == 0 ? 0.0 : 2.0, offset = 0.03 * ((k / 400) % 3);
    const double values[] = {1.0 * k, x, 20.0 + air, offset, error(x, air, scale, offset) + reading(random)};
    for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(values[c]);
    scale += (air - scale) * (1.0 - std::exp(-1.0 / 45.0));
  }
  recording::Table table;
  const char* names[] = {"t", "x", "T", "o", "e"};
  const char* units[] = {"s", "m", "degC", "m", "m"};
  for (std::size_t c = 0; c < columns.size(); ++c) table.add(names[c], units[c], columns[c]);
  return make_case(
      test::model_of("invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, error: e" +
                     more_columns +
                     "}\nbaseline: {positions: [-0.1, -0.05, 0, 0.05, 0.1], errors: [0, 0, 0, 0, 0]}\n"
                     "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0.05}" +
                     expansion + "}\nterms: []\n"),
      {table});
}

TEST(ErrorMaps, AScaleThatFollowsByLessThanAMinuteIsNoOtherExpansion) {
  auto data = swept(
      ", temperature: T", ", expansion: {value: 1.7e-5, unit: 1/K, sigma: 3.5e-7}",
      [](double x, double, double scale, double) { return 1.7e-5 * scale * x; }, 17);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "heating_rate_lag");
  EXPECT_NEAR(d.findings[0].term.values[0], 45.0, 7.0);
  EXPECT_EQ(d.verdict, Verdict::explained);
}

TEST(ErrorMaps, ACarriageMaySwingToEitherSideAlongTheWay) {
  auto data = swept(
      ", offset: o", "",
      [](double x, double, double, double offset) {
        return offset * 2e-5 * std::sin(2.0 * M_PI * x / travel);
      },
      18);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "abbe_offset");
}

physics::Model tachometer() {
  return test::model_of(
      "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: x, velocity_sensor: v}\n"
      "parameters: {resolution: {value: 1e-7, unit: m, sigma: 0}, gain: {value: 1, sigma: 0.01}}\nterms: "
      "[]\n");
}

TEST(Instruments, SpikesThatFallTogetherByChanceHideNoBias) {
  std::mt19937 random{20};
  std::normal_distribution<double> reading{0.0, 1e-4};
  std::uniform_real_distribution<double> chance{0.0, 1.0};
  std::vector<double> time, position, velocity;
  for (int k = 0; k < 12000; ++k) {
    const double t = 1e-3 * k;
    time.push_back(t), position.push_back(0.05 * std::sin(2.0 * t));
    const double spike = chance(random) < 0.02 ? (chance(random) < 0.5 ? -1.0 : 1.0) * 5e-3 : 0.0;
    velocity.push_back(0.1 * std::cos(2.0 * t) + 4e-5 + spike + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("v", "m/s", velocity);
  auto data = make_case(tachometer(), {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "bias");
  EXPECT_NEAR(d.findings[0].term.values[0], 4e-5, 5e-6);
}

TEST(Instruments, ABiasBesideADroopAreTwoNames) {
  // The droop alone hardly shows beside the bias: the gain may take most of it.
  std::mt19937 random{24};
  std::normal_distribution<double> reading{0.0, 9e-4};
  std::vector<double> time, position, velocity;
  for (int k = 0; k < 5300; ++k) {
    const double t = 2e-3 * k, v = 0.0225 * std::sin(3.1 * t) * std::cos(0.7 * t);
    time.push_back(t);
    position.push_back(position.empty() ? 0.0 : position.back() + 2e-3 * v);
    velocity.push_back(v / (1.0 + 2.5 * std::abs(v)) + 2.7e-4 + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("v", "m/s", velocity);
  auto data = make_case(
      test::model_of(
          "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: x, velocity_sensor: v}\n"
          "parameters: {resolution: {value: 1e-6, unit: m, sigma: 0}, gain: {value: 1, sigma: "
          "0.005}}\nterms: []\n"),
      {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 2U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "bias");
  EXPECT_EQ(d.findings[1].term.info->name, "gain_droop");
  EXPECT_NEAR(d.findings[0].term.values[0], 2.7e-4, 5e-5);
  EXPECT_NEAR(d.findings[1].term.values[0], 2.4, 0.6);
}

/// A scale that reads in steps [m] beside a reference.
Case scale_beside(const std::vector<double>& time, const std::vector<double>& position,
                  const std::vector<double>& shown, double step) {
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("y", "m", shown);
  return make_case(
      test::model_of("invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: x, encoder: y}\n"
                     "parameters: {resolution: {value: " +
                     std::to_string(1e9 * step) + ", unit: nm, sigma: 0}}\nterms: []\n"),
      {table});
}

TEST(Instruments, ALongWaveIsFoundThoughMostRowsStandAtTheEnds) {
  std::mt19937 random{21};
  std::normal_distribution<double> reading{0.0, 2e-8};
  std::vector<double> time, position, shown;
  std::uniform_real_distribution<double> moves{0.25, 0.7}, rests{0.0, 0.3};
  double begin = 0.0, lasts = 0.4, rest = 0.1;
  bool up = true;
  for (int k = 0; k < 3000; ++k) {
    const double t = 2e-3 * k;
    if (t > begin + lasts + rest) begin = t, lasts = moves(random), rest = rests(random), up = !up;
    const double q = std::min(1.0, (t - begin) / lasts), way = q * q * q * (10.0 - 15.0 * q + 6.0 * q * q);
    const double x = -0.0088 + 0.0136 * (up ? way : 1.0 - way);
    time.push_back(2e-3 * k), position.push_back(x);
    shown.push_back(x + 4e-8 * std::sin(2.0 * M_PI * x / 0.0037 + 1.0) + reading(random));
  }
  auto data = scale_beside(time, position, shown, 1e-9);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "periodic_error");
  EXPECT_NEAR(d.findings[0].term.values[1], 0.0037, 1e-4);
}

/// A scale beside a reference over strokes of 0.4 s between which the carriage rests for `rest` [s]; `shown` of where the
/// carriage stands at any time, and of the time [s].
template <class Shown>
Case stroked(double rest, std::size_t rows, double noise_of_scale, Shown shown, unsigned seed,
             double step = 1e-9) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading;
  std::uniform_real_distribution<double> ends{-0.04, 0.04};
  std::vector<double> stops(1, 0.0);
  for (int k = 0; k < 200; ++k) stops.push_back(ends(random));
  const auto place = [&](double t) {
    const auto k = static_cast<std::size_t>(std::max(0.0, t) / (0.4 + rest));
    const double q = std::clamp((t - static_cast<double>(k) * (0.4 + rest)) / 0.4, 0.0, 1.0);
    return stops[k] + (stops[k + 1] - stops[k]) * q * q * q * (10.0 - 15.0 * q + 6.0 * q * q);
  };
  std::vector<double> time, position, shows;
  for (std::size_t k = 0; k < rows; ++k) {
    time.push_back(2e-3 * static_cast<double>(k)), position.push_back(place(time.back()));
    shows.push_back(shown(place, time.back()) + noise_of_scale * reading(random));
  }
  return scale_beside(time, position, shows, step);
}

std::set<std::string> names_of(const Diagnosis& d) {
  std::set<std::string> names;
  for (const auto& finding : d.findings) names.emplace(finding.term.info->name);
  return names;
}

TEST(Instruments, AWaveAlongTheWayIsFoundThoughTheCarriageMostlyRests) {
  auto data = stroked(
      0.6, 6000, 3e-8,
      [](const auto& place, double t) {
        return place(t) + 2.5e-8 * std::sin(2.0 * M_PI * place(t) / 0.0031 + 1.0);
      },
      22);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(names_of(d), std::set<std::string>{"periodic_error"});
  EXPECT_EQ(d.verdict, Verdict::explained);
}

TEST(Instruments, WhatTheirOwnStepsMakeOfASteadyMotionIsNoWave) {
  constexpr double step = 7.01704e-8, reach = 0.0221, stroke = 1.3017;  // [m], [m], [s]
  std::mt19937 random{34};
  std::normal_distribution<double> shaken{0.0, 1.5e-8};
  const auto place = [](double t) { return reach * (2.0 * std::abs(std::remainder(t / stroke, 2.0)) - 1.0); };
  std::vector<double> time, position, shows;
  for (std::size_t k = 0; k < 20000; ++k) {
    time.push_back(1e-3 * static_cast<double>(k)), position.push_back(place(time.back()));
    shows.push_back(
        1e-11 * std::round(1e11 * step * std::round((place(time.back() - 3e-7) + shaken(random)) / step)));
  }
  auto data = scale_beside(time, position, shows, step);
  EXPECT_FALSE(names_of(diagnose(data, [](double, const std::string&) {})).contains("periodic_error"));
}

TEST(Instruments, AWaveIsNotTakenForABeatOfTheStepsWithTheDigitsTheyAreWrittenIn) {
  constexpr double step = 1.07792971e-6;
  auto data = stroked(
      0.02, 12000, 0.0,
      [random = std::mt19937{27}](const auto& place, double t) mutable {
        const double noise_of_scale = std::normal_distribution<double>{0.0, 5e-7}(random);
        const double shows =
            place(t) + 2.5e-7 * std::sin(2.0 * M_PI * place(t) / 0.01653 + 1.0) + noise_of_scale;
        return 1e-9 * std::round(1e9 * step * std::round(shows / step));
      },
      27, step);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(names_of(d), std::set<std::string>{"periodic_error"});
}

TEST(Instruments, WhatIsLateThroughPlayIsFoundAsBoth) {
  double shown = 0.0;
  auto data = stroked(
      0.1, 4000, 3e-8,
      [&](const auto& place, double t) {
        const double late = place(t - 3e-5);
        return shown = std::clamp(shown, late - 5e-8, late + 5e-8);
      },
      23);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(names_of(d), (std::set<std::string>{"hysteresis", "latency"}));
  for (const auto& finding : d.findings) {
    EXPECT_NEAR(finding.term.values[0], finding.term.info->name == "latency" ? 3e-5 : 1e-7,
                finding.term.info->name == "latency" ? 3e-7 : 1e-8);
    if (finding.term.info->name == "latency") {
      EXPECT_GT(finding.probability, 0.9);
    }
  }
}

// At one speed there and back, what is late stands behind by as much as play holds back, and turns with the direction too.
TEST(Instruments, LatenessAtOneSpeedIsNotToldFromPlay) {
  std::mt19937 random{26};
  std::normal_distribution<double> reading{0.0, 7e-8};
  std::vector<double> time, position, shown;
  constexpr double late = 4.6e-4, rate = 2.8e-4;
  const auto place = [](double t) { return rate * std::abs(std::remainder(t, 80.0)); };
  for (int k = 0; k < 4000; ++k) {
    time.push_back(10.0 + 0.2 * k), position.push_back(place(time.back()));
    shown.push_back(place(time.back() - late) + reading(random));
  }
  shown[0] = std::nan("");  // where the play stood at first nobody knows
  auto data = scale_beside(time, position, shown, 1e-9);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::ambiguous);
  EXPECT_THAT(names_of(d),
              ::testing::AnyOf(std::set<std::string>{"latency"}, std::set<std::string>{"hysteresis"}));
}

TEST(Wander, IsNotSeenInNoiseWithoutMemory) {
  int seen = 0, found = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    std::vector<double> white(1500), walked(1500);
    double walk = 0.0;
    for (std::size_t i = 0; i < white.size(); ++i) {
      white[i] = normal(random);
      walk = 0.99 * walk + 0.05 * normal(random);
      walked[i] = white[i] + walk;
    }
    seen += wander_of({white}, true).driven > 0.0 ? 1 : 0;
    found += wander_of({walked}, true).driven > 0.0 ? 1 : 0;
  }
  EXPECT_LE(seen, 2);
  EXPECT_GE(found, 36);
}

/// A carriage on two sinusoids under a tachometer that reads `reads(velocity, position)`.
template <class Reads>
Case under_tachometer(unsigned seed, Reads reads) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, 4e-4};
  std::vector<double> time, position, velocity;
  for (int k = 0; k < 6000; ++k) {
    const double t = 1e-3 * k;
    const double v = 0.12 * std::cos(2.3 * t) + 0.05 * std::cos(5.1 * t + 1.0);
    time.push_back(t);
    position.push_back(0.12 / 2.3 * std::sin(2.3 * t) + 0.05 / 5.1 * std::sin(5.1 * t + 1.0));
    velocity.push_back(reads(v, position.back()) + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("v", "m/s", velocity);
  return make_case(tachometer(), {table});
}

TEST(Instruments, ATachometerThatSticksBesideRestIsLocatedThere) {
  auto data = under_tachometer(19, [](double v, double) { return v - 8e-4 * std::tanh(v / 0.004); });
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.best.model.terms.back().curve.over, "velocity");
}

TEST(Instruments, ATachometerThatRipplesWithItsSpeedIsDrawnAlongTheWay) {
  auto data = under_tachometer(
      25, [](double v, double x) { return v * (1.0 + 5e-3 * std::sin(2.0 * M_PI * x / 0.013)); });
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.best.model.terms.back();
  EXPECT_EQ(term.curve.over, "true_position");
  EXPECT_EQ(term.with, "velocity");
  EXPECT_NEAR(term.curve.period, 0.013, 2e-4);
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
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 2U);
  for (const auto& finding : d.findings) {
    EXPECT_EQ(finding.term.curve.over, "on_time");
    const double gone = finding.term.curve(3.8e-4) - finding.term.curve(2.2e-4);
    EXPECT_NEAR(gone, finding.term.on == "landed_x" ? 4.8e-5 : -3.36e-5, 6e-6);
  }
}

}  // namespace
}  // namespace invar::diagnosis
