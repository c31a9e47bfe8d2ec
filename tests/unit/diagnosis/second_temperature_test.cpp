// Error maps with a second thermometer: the temperature that an effect goes with is found, named, written down and simulated.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/model_files.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/model_file.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using invar::testing::fault_of;
using ::testing::HasSubstr;

constexpr double noise = 1e-7, travel = 0.4;

constexpr const char* model_text =
    "invar_model: 1\nplant: error_map\n"
    "columns: {time: t, position: x, temperature: bed, temperature_spindle: spindle, error: e}\n"
    "baseline: {positions: [0, 0.2, 0.4], errors: [0, 0, 0]}\n"
    "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0},\n"
    "             expansion: {value: 4e-6, unit: 1/K, sigma: 4e-7}}\nnoise: {error: 1e-7}\nterms: []\n";

/// A machine whose bed follows the room over hours while its spindle warms and cools with the work; `error` is asked for the
/// position [m], both warmths and the spindle's of 400 s ago [K].
template <class Error>
recording::Table two_thermometers(unsigned seed, Error error) {
  std::mt19937 random{seed};
  std::normal_distribution<double> reading{0.0, noise};
  std::vector<double> time, position, bed, spindle, errors;
  const auto of_bed = [](double t) { return 3.0 * std::sin(2.0 * M_PI * t / 40000.0); };
  const auto of_spindle = [](double t) { return 6.0 + 5.0 * std::sin(2.0 * M_PI * t / 9000.0 + 0.7); };
  for (int k = 0; k < 600; ++k) {
    const double t = 60.0 * k, x = travel * (k % 17) / 16.0;
    time.push_back(t), position.push_back(x);
    bed.push_back(20.0 + of_bed(t)), spindle.push_back(20.0 + of_spindle(t));
    errors.push_back(4e-6 * of_bed(t) * x + error(x, of_bed(t), of_spindle(t)) + reading(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("bed", "degC", bed);
  table.add("spindle", "degC", spindle);
  table.add("e", "m", errors);
  return table;
}

template <class Error>
Case case_of(unsigned seed, Error error) {
  return make_case(test::model_of(model_text), {two_thermometers(seed, error)});
}

Diagnosis diagnosed(Case& data) {
  return diagnose(data, [](double, const std::string&) {});
}

TEST(SecondTemperature, AnExpansionWithTheSpindleIsNamedWithItsThermometer) {
  auto data = case_of(41, [](double x, double, double spindle) { return 2e-6 * spindle * x; });
  const auto d = diagnosed(data);
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.info->name, "thermal_expansion") << summary(data, d);
  EXPECT_EQ(term.on, "temperature_spindle");
  EXPECT_NEAR(term.values[0], 2e-6, 1e-7);
  EXPECT_LT(d.heldout[0].after, 1.2 * noise);
  const auto report = nlohmann::json::parse(report_json(data, d));
  EXPECT_THAT(report.at("location").at(0).at("depends_on").dump(), HasSubstr("temperature_spindle"));
  EXPECT_THAT(report.at("findings").at(0).dump(), HasSubstr("temperature_spindle"));
}

TEST(SecondTemperature, AHeadThatGrowsWithTheSpindleAloneIsACurveOverThatTemperature) {
  auto data = case_of(42, [](double, double, double spindle) { return 2e-7 * spindle * spindle; });
  const auto d = diagnosed(data);
  ASSERT_FALSE(d.findings.empty()) << summary(data, d);
  EXPECT_EQ(d.best.model.terms.back().curve.over, "temperature_spindle") << summary(data, d);
  EXPECT_LT(d.heldout[0].after, 1.5 * noise);
}

TEST(SecondTemperature, NoEffectNamesNone) {
  auto data = case_of(43, [](double, double, double) { return 0.0; });
  const auto d = diagnosed(data);
  EXPECT_TRUE(d.findings.empty()) << summary(data, d);
}

/// The patched model is read again and simulates the machine as well as the diagnosis says.
TEST(SecondTemperature, ThePatchedModelSimulatesIt) {
  auto data = case_of(41, [](double x, double, double spindle) { return 2e-6 * spindle * x; });
  const auto d = diagnosed(data);
  const auto yaml = config::Yaml::parse(model_text, "model.yaml");
  const auto files = model_files(yaml, test::model_of(model_text), "model.yaml", data, d);
  EXPECT_THAT(files.patched, HasSubstr("on: temperature_spindle"));
  const auto patched = test::model_of(files.patched);
  const auto fresh =
      two_thermometers(44, [](double x, double, double spindle) { return 2e-6 * spindle * x; });
  auto other = make_case(patched, {fresh});
  const auto simulated = simulate(other, patched);
  double square = 0.0;
  for (std::size_t i = 0; i < simulated[0][0].size(); ++i)
    square += std::pow(other.recordings[0].measured[0][i] - simulated[0][0][i], 2);
  EXPECT_LT(std::sqrt(square / static_cast<double>(simulated[0][0].size())), 1.2 * noise);
}

/// Closed form: a scale that follows its thermometer with a time constant lags a ramp by rate times time constant.
TEST(SecondTemperature, ALagBelongsToItsOwnThermometer) {
  const auto model = test::model_of(
      std::string{model_text}.replace(std::string{model_text}.find("terms: []"), 9,
                                      "terms:\n"
                                      "  - {term: thermal_expansion, on: temperature_spindle, coefficient: "
                                      "{value: 1e-6, unit: 1/K}}\n"
                                      "  - {term: heating_rate_lag, on: temperature_spindle, time_constant: "
                                      "{value: 100, unit: s}}"));
  physics::Record inputs;
  for (int k = 0; k < 300; ++k) {
    inputs.time.push_back(10.0 * k);
    inputs.signals["position"].push_back(travel);
    inputs.signals["temperature"].push_back(20.0 + 0.001 * 10.0 * k);
    inputs.signals["temperature_spindle"].push_back(20.0 + 0.002 * 10.0 * k);
  }
  physics::Outputs outputs;
  physics::prepare(model, inputs)->run(model, outputs);
  const double t = inputs.time.back();
  EXPECT_NEAR(outputs[0].back(), travel * (4e-6 * 0.001 * t + 1e-6 * 0.002 * (t - 100.0)), 1e-14);
}

TEST(SecondTemperature, ATermOfAThermometerThatIsNoneIsRefused) {
  const auto with = [](const char* term) {
    std::string text{model_text};
    return text.replace(text.find("terms: []"), 9, std::string{"terms:\n  - "} + term);
  };
  EXPECT_THAT(fault_of([&] { (void)test::model_of(with("{term: thermal_expansion, on: temperature_bed}")); }),
              HasSubstr("`temperature_bed` is no temperature of this model"));
  EXPECT_THAT(fault_of([&] { (void)test::model_of(with("{term: sag, on: temperature_spindle}")); }),
              HasSubstr("`sag` acts at one place alone"));
}

}  // namespace
}  // namespace invar::diagnosis
