// Where the dispenser aims: its patterns, moved by the trajectory model in use.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/compensation/trajectory_file.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/dispenser/dispenser_bench.hpp"

namespace invar::dispenser {
namespace {

namespace fs = std::filesystem;
using namespace dispensing;
using Bench = testing::DispenserBench;

TEST(Dispenser, AnswersWithTargetsAsTheyAreWhereNoModelIsInUse) {
  Bench bench;
  bench.bring_up();
  const TriggerPattern pattern = bench.ask("grid", 2e-3);
  ASSERT_EQ(pattern.points().size(), 6U);
  EXPECT_EQ(pattern.points()[0].droplet(), 1U);
  for (const TriggerPoint& point : pattern.points()) {
    EXPECT_EQ(point.position()[0], point.target()[0]);
    EXPECT_EQ(point.position()[1], point.target()[1]);
    EXPECT_EQ(point.position()[2], 2e-3);
    EXPECT_EQ(point.lead_ns(), 0);
  }
  EXPECT_NEAR(pattern.points()[3].target()[0], 0.064, 1e-15);  // forth and back
  EXPECT_NE(bench.ask("grit", 2e-3).refusal().size(), 0U);
  EXPECT_NE(bench.ask("grid", 0.0).refusal().size(), 0U);
}

/// compensation.yaml of the thesis's head with a delay of 0.3 ms and 2 m/s.
fs::path write_model(const invar::testing::TemporaryFolder& folder, double placement_y = 118.2e-6,
                     double slope_sigma = 1e-4, const Eigen::Matrix2d& field = Eigen::Matrix2d::Zero()) {
  metrology::DropletTrajectory path;
  path.placement << 2.0e-6, placement_y;
  path.slope << 5.30508e-3, 9.01832e-5;
  path.slowness = 0.5;
  path.delay = 3e-4;
  path.covariance << 1e-12, 0.0, 0.0, slope_sigma * slope_sigma;
  path.field = field;
  path.field_centre << 0.05, 0.06;
  path.least_height = 2e-3;
  path.most_height = 20e-3;
  const auto source = folder.write("droplets.csv", "made up\n");
  compensation::ModelText text{"dispenser", {source}};
  compensation::write_trajectory(text, path);
  text.write(folder / "compensation.yaml");
  return folder / "compensation.yaml";
}

TEST(Dispenser, MovesItsTargetsByTheModelInUseAndBack) {
  invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, write_model(folder)).state(), compensation::MODEL_STAGED);
  EXPECT_EQ(bench.ask("grid", 2e-3).model_checksum(), 0U);  // not yet
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const TriggerPattern pattern = bench.ask("grid", 20e-3);
  EXPECT_NE(pattern.model_checksum(), 0U);
  for (const TriggerPoint& point : pattern.points()) {
    // The golden numbers of the thesis's head at 20 mm, and 0.3 ms + 20 mm / 2 m/s.
    EXPECT_NEAR(point.target()[0] - point.position()[0], 108.102e-6, 1e-9);
    EXPECT_NEAR(point.target()[1] - point.position()[1], 120.004e-6, 1e-9);
    EXPECT_EQ(point.lead_ns(), 10'300'000);
  }
  EXPECT_EQ(bench.change(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_NONE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 0);
}

TEST(Dispenser, AimsByTheFieldOfItsModel) {
  invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  Eigen::Matrix2d field;
  field << 2e-4, -7e-4, 8e-4, -1e-4;
  bench.change(compensation::MODEL_STAGE, write_model(folder, 118.2e-6, 1e-4, field));
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const TriggerPattern pattern = bench.ask("grid", 20e-3);
  ASSERT_GT(pattern.points().size(), 3U);
  for (const TriggerPoint& point : pattern.points()) {
    const Eigen::Vector2d aimed{point.position()[0], point.position()[1]};
    const Eigen::Vector2d lands =
        aimed + Eigen::Vector2d{108.102e-6, 120.004e-6} + field * (aimed - Eigen::Vector2d{0.05, 0.06});
    EXPECT_NEAR(lands.x(), point.target()[0], 1e-9);
    EXPECT_NEAR(lands.y(), point.target()[1], 1e-9);
  }
}

// What `invar diagnose` writes of the same head: patched.yaml of plant droplet.
TEST(Dispenser, AimsByADiagnosedModelOfTheHead) {
  const invar::testing::TemporaryFolder folder;
  const auto head = [&](const std::string& slope_sigma, const std::string& more) {
    folder.write("patched.yaml",
                 "invar_model: 1\nplant: droplet\ncolumns: {target_x: tx, target_y: ty, height: h, time: t, "
                 "landed_x: x, "
                 "landed_y: y, velocity_x: vx, velocity_y: vy}\nparameters:\n"
                 "  placement_error_x: {value: 2.0e-6, unit: m, sigma: 1e-6}\n"
                 "  placement_error_y: {value: 118.2e-6, unit: m, sigma: 1e-6}\n"
                 "  slope_x: {value: 5.3051e-3, unit: 1" +
                     slope_sigma +
                     "}\n"
                     "  slope_y: {value: 9.0188e-5, unit: 1" +
                     slope_sigma +
                     "}\n"
                     "  speed: {value: 3, unit: m/s}\n"
                     "terms:\n  - {term: stage_velocity_carry, speed: {value: 2, unit: m/s}}\n"
                     "  - {term: valve_delay, delay: {value: 3e-4, unit: s}}\n"
                     "  - {term: camera_rotation, angle: {value: 1e-3, unit: rad}}\n" +
                     more);
    return folder / "patched.yaml";
  };
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, head(", sigma: 1e-4", "")).state(),
            compensation::MODEL_STAGED);
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const TriggerPattern pattern = bench.ask("grid", 20e-3);
  EXPECT_NE(pattern.model_checksum(), 0U);
  ASSERT_EQ(pattern.points().size(), 6U);
  for (const TriggerPoint& point : pattern.points()) {
    EXPECT_NEAR(point.target()[0] - point.position()[0], 108.102e-6, 1e-9);
    EXPECT_NEAR(point.target()[1] - point.position()[1], 120.004e-6, 1e-9);
    EXPECT_EQ(point.lead_ns(), 10'300'000);
  }
  // A slope of which nothing is known aims at nothing.
  bench.change(compensation::MODEL_STAGE, head("", ""));
  bench.change(compensation::MODEL_ACTIVATE);
  EXPECT_THAT(bench.ask("grid", 20e-3).refusal().c_str(), ::testing::HasSubstr("not certain enough"));
  folder.write("axis.yaml",
               "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: x, encoder: e}\n");
  const auto other = bench.change(compensation::MODEL_STAGE, folder / "axis.yaml");
  EXPECT_EQ(other.state(), compensation::MODEL_REFUSED);
  EXPECT_THAT(other.text().c_str(), ::testing::HasSubstr("of plant sensor, not of a head"));
}
TEST(Dispenser, TakesItsModelOutAndBackInAndHasNoTransactions) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  bench.change(compensation::MODEL_STAGE, write_model(folder));
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  for (const auto kind : {compensation::MODEL_KEEP, compensation::MODEL_COMMIT}) {
    const auto answer = bench.change(kind);
    EXPECT_EQ(answer.state(), compensation::MODEL_REFUSED);
    EXPECT_THAT(answer.text().c_str(), ::testing::HasSubstr("no transactions"));
    EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 10'300'000);  // still in use
  }
  EXPECT_EQ(bench.change(compensation::MODEL_CLEAR).state(), compensation::MODEL_NONE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 0);
  EXPECT_EQ(bench.change(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_ACTIVE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 10'300'000);
}

TEST(Dispenser, RefusesModelsThatMustNotAim) {
  invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_REFUSED);
  const auto far = bench.change(compensation::MODEL_STAGE, write_model(folder, 3e-3));
  EXPECT_EQ(far.state(), compensation::MODEL_REFUSED);
  EXPECT_THAT(far.text().c_str(), ::testing::HasSubstr("bound"));
  std::stringstream sealed;
  sealed << std::ifstream{write_model(folder)}.rdbuf();
  std::string edited = sealed.str();
  edited.replace(edited.find("slope:"), 6, "slope: [0.1, 0.1]\nold:");
  folder.write("compensation.yaml", edited);
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, folder / "compensation.yaml").state(),
            compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, folder / "nothing.yaml").state(),
            compensation::MODEL_REFUSED);
  // Certain between the heights that it was identified at, not far beyond.
  bench.change(compensation::MODEL_STAGE, write_model(folder, 118.2e-6, 4e-3));
  bench.change(compensation::MODEL_ACTIVATE);
  EXPECT_EQ(bench.ask("grid", 20e-3).refusal().size(), 0U);
  EXPECT_THAT(bench.ask("grid", 60e-3).refusal().c_str(), ::testing::HasSubstr("not certain enough"));
}

TEST(Pattern, ReadsATableAndSaysWhichRowIsWrong) {
  invar::testing::TemporaryFolder folder;
  Pattern pattern;
  pattern.kind = "file";
  pattern.file = folder.write("logo.csv", "target_x [mm],target_y [mm]\n60,50\n61.5,50\n");
  const auto points = targets(pattern);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_NEAR(points[1].x(), 0.0615, 1e-15);
  pattern.file = folder.write("hole.csv", "target_x [mm],target_y [mm]\n60,50\n61.5,\n");
  EXPECT_THROW((void)targets(pattern), InputError);
  pattern.kind = "line";
  pattern.from = {0.0, 0.0};
  pattern.to = {0.03, 0.04};
  pattern.droplets = 6;
  const auto line = targets(pattern);
  EXPECT_NEAR((line[1] - line[0]).norm(), 0.01, 1e-15);
}

}  // namespace
}  // namespace invar::dispenser
