// Effects without a name that a curve over one signal cannot describe: it is multiplied by another, or it remembers. The
// truth is written out here, point by point.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

Diagnosis diagnosed(Case& data) {
  return diagnose(data, [](double, const std::string&) {});
}

bool is_curve(const Finding& f, const std::string& site, const std::string& over, const std::string& with) {
  return f.term.info->name == "unmodelled" && f.term.info->site == site && f.term.curve.over == over &&
         f.term.with == with;
}

/// A glass scale beside an interferometer, to and fro; its scale grows by `growth` while it warms.
Case warming_scale(double growth, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 1e-7};
  std::vector<double> time, position, reading;
  for (int i = 0; i < 3000; ++i) {
    const double t = 0.01 * i, x = 0.1 + 0.08 * std::sin(1.3 * t) + 0.015 * std::sin(3.7 * t);
    time.push_back(t), position.push_back(x);
    reading.push_back(x * (1.0 + growth * (1.0 - std::exp(-t / 12.0))) + noise(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("true", "m", position);
  table.add("encoder", "m", reading);
  return make_case(
      test::model_of("invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: true, encoder: "
                     "encoder}\nparameters: {resolution: {value: 0, unit: m, sigma: 0}}\n"
                     "noise: {encoder: 1e-7}\nterms: []\n"),
      {table});
}

TEST(FreeCurve, AScaleThatGrowsIsACourseOverTimeTimesThePosition) {
  auto data = warming_scale(2e-5, 31);
  const auto d = diagnosed(data);
  ASSERT_FALSE(d.findings.empty());
  EXPECT_TRUE(is_curve(d.findings[0], "measurement", "time", "true_position")) << summary(data, d);
  EXPECT_LT(d.heldout[0].after, 2.0 * 1e-7);
  const auto& curve = d.findings[0].term.curve;
  EXPECT_NEAR(curve(25.0) - curve(5.0), 2e-5 * (std::exp(-5.0 / 12.0) - std::exp(-25.0 / 12.0)), 1e-6);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("in proportion to true_position"));
}

TEST(FreeCurve, AScaleThatStaysIsNone) {
  auto data = warming_scale(0.0, 32);
  EXPECT_TRUE(diagnosed(data).findings.empty());
}

TEST(FreeCurve, ASlideThatBowsAsItWarmsIsACourseAlongTheWayTimesTheTemperature) {
  std::mt19937 random{33};
  std::normal_distribution<double> noise{0.0, 1e-7};
  std::vector<double> time, position, warm, error;
  for (int k = 0; k < 400; ++k) {
    const double s = (k % 20) / 19.0, t = 20.0 + 8.0 * std::sin(0.02 * k);
    time.push_back(10.0 * k), position.push_back(0.3 * s), warm.push_back(t);
    // A bow that is not in the middle, and so no parabola.
    error.push_back(4e-7 * (t - 20.0) * std::sin(M_PI * s) * (1.0 + s) + noise(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("warm", "degC", warm);
  table.add("e", "m", error);
  auto data = make_case(
      test::model_of(
          "invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, temperature: warm, error: e}\n"
          "baseline: {positions: [0, 0.1, 0.2, 0.3], errors: [0, 0, 0, 0]}\n"
          "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0.01}}\n"
          "noise: {error: 1e-7}\nterms: []\n"),
      {table});
  const auto d = diagnosed(data);
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  EXPECT_TRUE(is_curve(d.findings[0], "thermal", "position", "temperature")) << summary(data, d);
  EXPECT_LT(d.heldout[0].after, 2.0 * 1e-7);
}

/// A mass on a spring and, with `limit` above 0, on three elements that bend and slip: hysteresis without a rate.
Case sprung_mass(double strength, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.003};
  std::vector<double> time, force, travel;
  double x = 0.0, v = 0.0;
  const std::vector<double> limits{0.3, 1.0, 2.5};
  std::vector<double> bent(limits.size(), 0.0);
  for (int i = 0; i < 2400; ++i) {
    const double t = 0.01 * i,
                 u = 4.0 * std::sin(2.0 * t) + 3.0 * std::sin(0.71 * t) + 2.0 * std::sin(4.9 * t);
    time.push_back(t), force.push_back(u), travel.push_back(x + noise(random));
    for (int part = 0; part < 100; ++part) {
      double held = 0.0;
      for (std::size_t k = 0; k < limits.size(); ++k) held += bent[k] / limits[k];
      const double h = 1e-4;
      v += h * (90.0 * u - 4.0 * v - 60.0 * x - strength * held);
      x += h * v;
      for (std::size_t k = 0; k < limits.size(); ++k)
        bent[k] = std::clamp(bent[k] + h * v, -limits[k], limits[k]);
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("force", "N", force);
  table.add("travel", "mm", travel);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: force}\n"
                     "states: {x: {derivative: 'v', initial: {value: 0, unit: mm, sigma: 0}}, "
                     "v: {derivative: 'b*u - c*v - k*x', initial: {value: 0, unit: mm/s, sigma: 0}}}\n"
                     "outputs: {travel: {column: travel, expression: x}}\n"
                     "parameters: {b: {value: 90, unit: 1, sigma: 3}, c: {value: 4, unit: 1, sigma: 0.5}, "
                     "k: {value: 60, unit: 1, sigma: 3}}\nnoise: {travel: 0.003}\nterms: []\n"),
      {table});
}

TEST(FreeCurve, HysteresisOfASpringStandsAtItsRateAndNotAtTheInstrument) {
  auto data = sprung_mass(30.0, 34);
  const auto d = diagnosed(data);
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  const auto curved = std::find_if(d.findings.begin(), d.findings.end(), [](const Finding& f) {
    return f.term.curve.memory == physics::Curve::Memory::stop;
  });
  ASSERT_NE(curved, d.findings.end()) << summary(data, d);
  EXPECT_EQ(curved->term.on, "v");
  EXPECT_LT(d.heldout[0].after, 0.2 * d.heldout[0].retuned);
}

TEST(FreeCurve, ASpringAloneHasNone) {
  auto data = sprung_mass(0.0, 35);
  const auto d = diagnosed(data);
  EXPECT_TRUE(d.findings.empty()) << summary(data, d);
}

}  // namespace
}  // namespace invar::diagnosis
