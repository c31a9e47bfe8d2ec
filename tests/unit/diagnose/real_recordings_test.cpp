// The diagnosis on recordings of real machines, read where they lie; says so where they are absent.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "core/model/model_file.hpp"
#include "tools/diagnose/search.hpp"

namespace invar::diagnose {
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

/// RMSE of one output of a model on the test run beside the recording.
double test_error(const physics::Model& model, const std::filesystem::path& folder, std::size_t output) {
  const auto inputs = model::to_record(recording::Table::read(csv(folder, "test_inputs")), model, false);
  const auto& signal = *model.signal(model.outputs()[output]);
  const auto measured = recording::Table::read(csv(folder, "test_outputs")).in(signal.column, signal.unit);
  physics::Outputs out;
  physics::prepare(model, inputs.record)->run(model, out);
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < measured.size(); ++i)
    if (std::isfinite(measured[i])) sum += std::pow(measured[i] - out[output][i], 2), n += 1.0;
  return std::sqrt(sum / n);
}

TEST(RealRecordings, TwoHeatersWarmEachOtherAndTheirSensorsLag) {
  const auto folder = shared() / "data" / "tclab-two-heaters";
  if (!is_there(folder)) return;
  const auto model = model::load(folder / "model.yaml");
  auto data = load_case(model, {folder / "recording.csv"});
  const auto d = search(data, [](double, const std::string&) {});
  std::vector<std::string> names;
  for (const auto& finding : d.findings) names.emplace_back(finding.term.info->name);
  EXPECT_THAT(names, ::testing::Contains("node_coupling"));
  EXPECT_THAT(names, ::testing::Contains("sensor_lag"));
  for (std::size_t o = 0; o < 2; ++o)
    EXPECT_LT(test_error(d.best.model, folder, o), 0.8 * test_error(d.retuned.model, folder, o)) << o;
}

TEST(RealRecordings, APendulumIsBrakedByItsBearingAndByTheAir) {
  const auto folder = shared() / "data" / "pendulum-arm";
  if (!is_there(folder)) return;
  auto data = load_case(model::load(folder / "model.yaml"), {csv(folder, "recording")});
  const auto d = search(data, [](double, const std::string&) {});
  std::vector<std::string> names;
  for (const auto& finding : d.findings) names.emplace_back(finding.term.info->name);
  EXPECT_THAT(names, ::testing::Contains("dry_friction"));
  EXPECT_THAT(names, ::testing::Contains(::testing::AnyOf("quadratic", "cubic")));
  for (const auto& finding : d.findings) EXPECT_EQ(finding.term.on, "w");
  EXPECT_LT(test_error(d.best.model, folder, 0), 0.5 * test_error(d.retuned.model, folder, 0));
}

TEST(RealRecordings, AWhiffleBallIsBrakedByTheAirAndAGolfBallHardly) {
  const auto folder = shared() / "data" / "ball-drops";
  if (!is_there(folder)) return;
  const auto model = model::load(folder / "model.yaml");
  auto light = load_case(model, {folder / "whiffle-ball-1" / "recording.csv"});
  const auto braked = search(light, [](double, const std::string&) {});
  ASSERT_FALSE(braked.findings.empty());
  EXPECT_EQ(braked.findings[0].term.on, "v");
  EXPECT_LT(braked.heldout[0].after, 0.1 * braked.heldout[0].retuned);
  auto heavy = load_case(model, {folder / "golf-ball" / "recording.csv"});
  EXPECT_TRUE(search(heavy, [](double, const std::string&) {}).findings.empty());
}

}  // namespace
}  // namespace invar::diagnose
