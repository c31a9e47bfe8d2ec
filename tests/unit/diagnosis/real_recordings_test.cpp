// The diagnosis on recordings of real machines, read where they lie; says so where they are absent.
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/other_run.hpp"
#include "core/model/model_file.hpp"
#include "core/recording/table.hpp"

namespace invar::diagnosis {
namespace {

std::filesystem::path shared() {
  if (const char* folder = std::getenv("INVAR_SHARED")) return folder;
  return std::filesystem::path{INVAR_SOURCE_DIR}.parent_path() / "shared";
}

bool is_there(const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "model.yaml")) return true;
  std::cout << "no recordings in " << folder << "; set INVAR_SHARED to the folder that holds data/\n";
  return false;
}

/// As it lies there: NAME.csv or NAME.csv.gz.
std::filesystem::path csv(const std::filesystem::path& folder, const std::string& name) {
  const auto plain = folder / (name + ".csv");
  return std::filesystem::exists(plain) ? plain : folder / (name + ".csv.gz");
}

struct Result {
  Diagnosis diagnosis;
  OtherRun test;  // the run that was held back
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& finding : diagnosis.findings) names.emplace_back(finding.term.info->name);
    return names;
  }
};

/// The recording alone is diagnosed; of a long one the first `rows`.
Result diagnose(const std::filesystem::path& folder, std::size_t rows = 0) {
  const auto own = folder / "model.yaml";
  const auto model = model::load(std::filesystem::exists(own) ? own : folder.parent_path() / "model.yaml");
  auto table = recording::Table::read(csv(folder, "recording"));
  for (auto& column : table.columns)
    if (rows > 0 && column.values.size() > rows) column.values.resize(rows);
  auto data = make_case(model, {table});
  Result result;
  result.diagnosis = diagnose(data, [](double, const std::string&) {});
  result.test = read_other_run(model, {csv(folder, "test_inputs"), csv(folder, "test_outputs"),
                                       folder.parent_path().filename() == "ball-drops"});
  compare(data, result.diagnosis, result.test);
  return result;
}

TEST(RealRecordings, TwoHeatersWarmEachOtherAndTheirSensorsLag) {
  const auto folder = shared() / "data" / "tclab-two-heaters";
  if (!is_there(folder)) return;
  const auto r = diagnose(folder);
  EXPECT_THAT(r.names(), ::testing::Contains("node_coupling"));
  EXPECT_THAT(r.names(), ::testing::Contains("sensor_lag"));
  for (const auto& row : r.test.fit) EXPECT_LT(row.after, 0.8 * row.retuned) << row.signal;
}

TEST(RealRecordings, APendulumIsBrakedByItsBearingAndByTheAir) {
  const auto folder = shared() / "data" / "pendulum-arm";
  if (!is_there(folder)) return;
  const auto r = diagnose(folder);
  EXPECT_THAT(r.names(), ::testing::Contains("dry_friction"));
  EXPECT_THAT(r.names(), ::testing::Contains(::testing::AnyOf("quadratic", "cubic")));
  // A curve without a name may stand beside them: of the encoder over its angle.
  for (const auto& finding : r.diagnosis.findings)
    EXPECT_TRUE(finding.term.on == "w" || finding.term.info->name == "unmodelled") << finding.term.info->name;
  EXPECT_THAT(r.names(), ::testing::Not(::testing::Contains("periodic")));  // of the arm's own swing
  EXPECT_LT(r.test.fit[0].after, 0.5 * r.test.fit[0].retuned);
}

TEST(RealRecordings, AnUpperTankRunsOverIntoTheLower) {
  const auto folder = shared() / "data" / "cascaded-tanks";
  if (!is_there(folder)) return;
  const auto r = diagnose(folder);
  // By its name, or as the nearest of an effect without one: it leaves fourteen times the noise, and processors round otherwise.
  EXPECT_TRUE(
      std::any_of(r.diagnosis.findings.begin(), r.diagnosis.findings.end(), [](const Finding& finding) {
        return finding.term.info->name == "overflow" ||
               (finding.stand_in != nullptr && finding.stand_in->name == "overflow");
      }));
  EXPECT_LT(r.test.fit[0].after, 0.5 * r.test.fit[0].retuned);
  EXPECT_LT(r.test.fit[0].after, 0.343);  // V: the best of table 2 in doi 10.1155/2021/6613425
}

TEST(RealRecordings, ALinearAxisHasDryFrictionAsItsMakersPublished) {
  const auto folder = shared() / "data" / "linear-axis-emps";
  if (!is_there(folder)) return;
  const auto r = diagnose(folder);
  // Janot, Gautier and Brunot 2019: friction 20.39 N, viscous 203.5 N s/m.
  ASSERT_FALSE(r.diagnosis.findings.empty());
  const auto& friction = r.diagnosis.findings[0].term;
  EXPECT_THAT(std::string{friction.info->name},
              ::testing::AnyOf("coulomb_friction", "stribeck_friction", "presliding_friction"));
  EXPECT_NEAR(friction.values[0], 20.39, 1.1);  // what the curve over position holds is in theirs
  EXPECT_NEAR(r.diagnosis.best.model.value("viscous_damping"), 203.5, 6.0);
  for (const auto& row : r.test.fit) EXPECT_LT(row.after, 0.8 * row.retuned) << row.signal;
  // What is held out speaks of the model that is handed over: another run of the axis says much the same.
  for (std::size_t o = 0; o < r.test.fit.size(); ++o)
    EXPECT_LT(r.diagnosis.heldout[o].after, 2.0 * r.test.fit[o].after) << r.test.fit[o].signal;
}

TEST(RealRecordings, AnElectronicSpringHardensWithTheCube) {
  const auto folder = shared() / "data" / "oscillator-silverbox";
  if (!is_there(folder)) return;
  const auto r = diagnose(folder, 3000);
  ASSERT_EQ(r.names(), std::vector<std::string>{"cubic"});
  EXPECT_EQ(r.diagnosis.findings[0].term.with, "x");
  EXPECT_LT(r.diagnosis.findings[0].term.values[0], 0.0);
  EXPECT_LT(r.test.fit[0].after, 0.2 * r.test.fit[0].retuned);
}

TEST(RealRecordings, AWhiffleBallIsBrakedByTheAirAndAGolfBallHardly) {
  const auto folder = shared() / "data" / "ball-drops";
  if (!is_there(folder)) return;
  const auto light = diagnose(folder / "whiffle-ball-1");
  ASSERT_FALSE(light.diagnosis.findings.empty());
  EXPECT_EQ(light.diagnosis.findings[0].term.on, "v");
  EXPECT_LT(light.test.fit[0].after, 0.2 * light.test.fit[0].retuned);
  EXPECT_TRUE(diagnose(folder / "golf-ball").diagnosis.findings.empty());
  // Rows that are related to one another bear out the drag and no second term.
  for (const char* ball : {"whiffle-ball-2", "yellow-whiffle-ball"})
    EXPECT_EQ(diagnose(folder / ball).names(), std::vector<std::string>{"linear"}) << ball;
}

}  // namespace
}  // namespace invar::diagnosis
