// The diagnosis on machines made here: the right name where physics is missing, none where nothing is.
#include "core/diagnosis/search/diagnose.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::diagnosis {
namespace {

class DiagnosisTest : public ::testing::Test {
 protected:
  Diagnosis diagnose_thermal(const std::vector<physics::Term>& truth_terms, double loss, unsigned seed,
                             const std::string& temperature = "T") {
    const auto model = test::model_of(
        "invar_model: 1\nplant: thermal\ncolumns: {time: t, speed: v}\n"
        "nodes: {slide: {column: " +
        temperature +
        ", capacity: {value: 800, unit: J/K, sigma: 40}, loss: {value: 9, unit: W/K, sigma: 0.5}}}\n"
        "heaters: {pad: {node: slide, column: P, gain: {value: 1, unit: W/W, sigma: 0.02}}}\n"
        "ambient: {value: 22, unit: degC, sigma: 0.05}\nnoise: {slide: 0.02}\n");
    auto truth = model;
    truth.parameters[1].value = loss;
    truth.terms = truth_terms;
    physics::Record inputs;
    std::mt19937 random{seed};
    std::normal_distribution<double> noise{0.0, 0.02};
    for (int i = 0; i < 1500; ++i) {
      inputs.time.push_back(2.0 * i);
      inputs.signals["pad"].push_back((i / 220) % 2 == 0 ? 90.0 : 20.0);
      inputs.signals["speed"].push_back((i / 130) % 2 == 0 ? 0.0 : 0.3);
    }
    physics::Outputs out;
    physics::prepare(truth, inputs)->run(truth, out);
    recording::Table table;
    for (double& y : out[0]) y += noise(random);
    table.add("t", "s", inputs.time);
    table.add("P", "W", inputs.signals["pad"]);
    table.add("v", "m/s", inputs.signals["speed"]);
    table.add(temperature, "degC", out[0]);
    table.write(folder / "recording.csv");
    data = load_case(model, {folder / "recording.csv"});
    return diagnose(data, [](double, const std::string&) {});
  }

  static physics::Term term(const char* name, double value) {
    physics::Term t;
    t.info = physics::find_term(physics::Plant::thermal, name);
    t.values[0] = value;
    t.given[0] = true;
    t.on = "slide";
    return t;
  }

  invar::testing::TemporaryFolder folder;
  Case data;
};

TEST_F(DiagnosisTest, ClaimsNothingWhereNothingIsMissing) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const auto d = diagnose_thermal({}, 9.2, seed);
    EXPECT_EQ(d.verdict, Verdict::no_mismatch) << "seed " << seed;
    EXPECT_TRUE(d.findings.empty()) << "seed " << seed;
  }
}

TEST_F(DiagnosisTest, SaysThatOnlyAParameterIsOff) {
  const auto d = diagnose_thermal({}, 12.0, 5);
  EXPECT_EQ(d.verdict, Verdict::parameters_only);
  EXPECT_NEAR(d.best.model.value("slide.loss"), 12.0, 0.2);
}

TEST_F(DiagnosisTest, NamesAndMeasuresConvectionUnderAnyColumnName) {
  for (const char* name : {"T", "zzz"}) {
    const auto d = diagnose_thermal({term("speed_dependent_convection", 4.0)}, 9.0, 7, name);
    EXPECT_EQ(d.verdict, Verdict::explained);
    ASSERT_EQ(d.findings.size(), 1U);
    EXPECT_EQ(d.findings[0].term.info->name, "speed_dependent_convection");
    EXPECT_NEAR(d.findings[0].term.values[0], 4.0, 0.4);
    EXPECT_LT(d.heldout[0].after, 0.5 * d.heldout[0].retuned);
    EXPECT_NEAR(d.heldout[0].after, 0.02, 0.003)
        << d.best.model.value("slide.capacity") << ' ' << d.best.model.value("slide.loss") << ' '
        << d.best.model.value("pad.gain") << ' ' << d.best.model.value("ambient") << ' ' << d.train[0].after
        << ' ' << d.findings[0].term.values[0];
  }
}

TEST_F(DiagnosisTest, NamesASensorLag) {
  const auto d = diagnose_thermal({term("sensor_lag", 12.0)}, 9.0, 3);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "sensor_lag");
  EXPECT_NEAR(d.findings[0].term.values[0], 12.0, 1.0);
}

TEST_F(DiagnosisTest, WritesAReportThatHoldsItsVerdictAndNumbers) {
  const auto d = diagnose_thermal({term("speed_dependent_convection", 4.0)}, 9.0, 9);
  const auto json = report_json(data, d);
  EXPECT_THAT(json, ::testing::HasSubstr("\"verdict\": \"explained\""));
  EXPECT_THAT(json, ::testing::HasSubstr("\"thermal.loss\""));
  EXPECT_THAT(json, ::testing::HasSubstr("\"W s/(K m)\""));
}

}  // namespace
}  // namespace invar::diagnosis
