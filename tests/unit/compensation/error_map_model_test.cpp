// A diagnosed error map in the hands of the compensation: the same error as its formula, at any place and temperature.
#include "core/compensation/error_map_model.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "core/model/model_file.hpp"
#include "tests/support/model_of.hpp"

namespace invar::compensation {
namespace {

constexpr const char* diagnosed = R"(invar_model: 1
plant: error_map
axis: y
columns: {position: x, time: t, temperature: T, error: e}
range: {temperature: [21, 25]}
baseline: {positions: [0, 0.05, 0.1, 0.15, 0.2], errors: [0, 1.0e-6, 2.0e-6, 3.0e-6, 4.0e-6]}
parameters:
  reference_temperature: {value: 20, unit: degC}
noise: {error: 1.0e-7}
terms:
  - {term: periodic_error, amplitude: {value: 3.0e-7, unit: m, sigma: 2.0e-8}, pitch: {value: 0.0125, unit: m, sigma: 0}, phase: {value: 0.4, unit: rad, sigma: 0}}
  - {term: sag, depth: {value: 8.0e-7, unit: m, sigma: 0}}
  - {term: thermal_expansion, coefficient: {value: 9.0e-6, unit: 1/K, sigma: 1.0e-7}}
  - {term: heating_rate_lag, time_constant: {value: 240, unit: s, sigma: 5}}
  - {term: refractive_index, coefficient: {value: 2.7e-7, unit: 1/hPa, sigma: 1e-9}, reference_pressure: {value: 1000, unit: hPa}}
)";

TEST(ErrorMapModel, IsTheErrorThatItsFormulaSays) {
  const auto map = test::model_of(diagnosed);
  EXPECT_EQ(map.baseline.axis, "y");
  ASSERT_EQ(why_not_corrected(map), "");
  const auto error = thermal_error_of(map);
  EXPECT_EQ(error.lag, 240.0);
  for (double x = 0.0; x <= 0.2; x += 0.0037)
    for (const double temperature : {21.0, 22.3, 25.0}) {
      const double s = x / 0.2;
      const double expected = 2e-5 * x + 3e-7 * std::sin(2.0 * std::numbers::pi * x / 0.0125 + 0.4) -
                              8e-7 * 4.0 * s * (1.0 - s) + 9e-6 * (temperature - 20.0) * x;
      EXPECT_NEAR(error.value({x, temperature, 0.0, {}}), expected, 1e-8) << x << ' ' << temperature;
      // Of the two that may be wrong: the wave's size, by the share of it that stands here, and the growth.
      const double wave = 2e-8 * std::sin(2.0 * std::numbers::pi * x / 0.0125 + 0.4),
                   growth = 1e-7 * (temperature - 20.0) * x;
      EXPECT_NEAR(error.sigma({x, temperature, 0.0, {}}), std::hypot(wave, growth), 1.5e-8);
    }
  // Outside its range it holds the end and says so.
  EXPECT_NEAR(error.value({0.1, 30.0, 0.0, {}}), error.value({0.1, 25.0, 0.0, {}}), 1e-12);
  EXPECT_GT(error.sigma({0.1, 30.0, 0.0, {}}), 3e-6);
}

TEST(ErrorMapModel, SaysWhatItCannotCorrect) {
  auto map = test::model_of(diagnosed);
  EXPECT_EQ(why_not_corrected(map.terms.back()),
            "");  // the laser's: left out, the machine errs no less for it
  map.baseline.temperature.reset();
  EXPECT_THAT(why_not_corrected(map), ::testing::HasSubstr("range: {temperature"));
  std::string with_backlash{diagnosed};
  with_backlash += "  - {term: backlash, width: {value: 1.0e-6, unit: m, sigma: 1e-8}}\n";
  auto other = test::model_of(with_backlash);
  EXPECT_THAT(std::string{why_not_corrected(other.terms.back())}, ::testing::HasSubstr("direction"));
  EXPECT_NEAR(thermal_error_of(other).value({0.07, 22.0, 0.0, {}}),
              thermal_error_of(test::model_of(diagnosed)).value({0.07, 22.0, 0.0, {}}), 1e-15);
}

TEST(ErrorMapModel, LeavesOutWhatGoesWithAnotherTemperature) {
  std::string text{diagnosed};
  text.replace(text.find("temperature: T,"), 15, "temperature: T, temperature_spindle: T2,");
  const auto without = test::model_of(text);
  const auto other = test::model_of(
      text +
      "  - {term: thermal_expansion, on: temperature_spindle, coefficient: {value: 5.0e-6, unit: 1/K}}\n"
      "  - {term: heating_rate_lag, on: temperature_spindle, time_constant: {value: 900, unit: s}}\n");
  EXPECT_THAT(std::string{why_not_corrected(other.terms.back())},
              ::testing::HasSubstr("reads one temperature"));
  const auto error = thermal_error_of(other);
  EXPECT_EQ(error.lag, 240.0);
  EXPECT_NEAR(error.value({0.15, 22.0, 0.0, {}}), thermal_error_of(without).value({0.15, 22.0, 0.0, {}}),
              1e-15);
}

TEST(ErrorMapModel, APatchedFileSaysOverWhichTemperaturesItWasFound) {
  const auto yaml = config::Yaml::parse(diagnosed, "model.yaml");
  auto changed = model::read(yaml);
  changed.baseline.temperature = Range{22.5, 24.25};
  const auto again = test::model_of(model::patched(yaml, changed));
  ASSERT_TRUE(again.baseline.temperature);
  EXPECT_EQ(again.baseline.temperature->lower, 22.5);
  EXPECT_EQ(again.baseline.temperature->upper, 24.25);
  EXPECT_EQ(again.baseline.axis, "y");
}

}  // namespace
}  // namespace invar::compensation
