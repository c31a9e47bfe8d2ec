// The job that identifies the sensors of an axis in the cell and puts their fusion to use.
#include "components/calibration/fusion_trial.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/compensation/fusion_file.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/trial_cell.hpp"

namespace invar::calibration {
namespace {

/// Axis x of deployment/axis-trials.yaml, on an encoder of 2 mm and a tachometer that is late, reads too little and less
/// with speed, which nobody told the fusion.
class FusionTrialTest : public ::testing::Test {
 protected:
  FusionTrialTest() {
    pair.of_tachometer.gain = 0.9;
    pair.of_tachometer.latency = 0.004;
    pair.of_tachometer.gain_droop = 0.3;
    pair.of_tachometer.noise_level = 0.02;  // the quieter, the more its properties are worth
    of_trial.sensors = {{"encoder", "position", "feedback"}, {"tachometer", "velocity", "port"}};
    of_trial.jobs.resize(1);
    of_trial.jobs[0].name = "fuse";
    of_trial.jobs[0].periods = {2.0, 3.0, 4.5};
    of_trial.jobs[0].verify_periods = {2.5};
    of_trial.jobs[0].out = (folder / "fuse").string();
  }
  /// Runs the job to its end.
  job::JobStatus run(bool laser_reads = true) {
    support::TrialCell<FusionTrial> cell{support::coarse_world(), support::coarse_stage(), of_trial,
                                         laser_reads};
    support::FusedX fused{cell.axis, pair};
    cell.join(fused);
    cell.bring_up();
    return cell.run("fuse");
  }
  [[nodiscard]] double fused_rms(const char* when) const {
    const auto table = recording::Table::read(folder / "fuse" / (std::string{"fusion_"} + when + ".csv"));
    const auto fused = table.in("fused", "m"), reference = table.in("reference", "m");
    std::vector<double> errors;
    for (std::size_t i = 0; i < fused.size(); ++i)
      if (std::isfinite(fused[i])) errors.push_back(fused[i] - reference[i]);
    return size_of(errors).rms;
  }

  const invar::testing::TemporaryFolder folder;
  support::FusedTachometer pair;
  FusionTrial::Parameters of_trial;
};

TEST_F(FusionTrialTest, FindsTheSensorsInTheCellAndLessensTheErrorOfRunsNotFitted) {
  const auto status = run();
  ASSERT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  std::cout << status.text().c_str() << '\n';
  const auto yaml = config::Yaml::load(folder / "fuse" / "compensation.yaml");
  compensation::check_seal(yaml);
  const auto model = compensation::read_fusion(yaml.root()).sensors;
  EXPECT_EQ(model.position_names, std::vector<std::string>{"encoder"});
  EXPECT_NEAR(model.positions[0].step, 2e-3, 1e-6);
  EXPECT_NEAR(model.velocities[0].lag, 0.003, 0.0015);  // the truth
  EXPECT_NEAR(model.velocities[0].response(0.15), 0.9 * 0.15 * (1.0 - 0.3 * 0.15), 0.002);
  EXPECT_LT(fused_rms("after"), 0.7 * fused_rms("before"));
}

TEST_F(FusionTrialTest, LeavesTheFusionAsItWasWhereTheNoiseHidesWhatAModelBrings) {
  pair.of_tachometer.noise_level = 0.3;
  pair.of_tachometer.gain = 1.0;  // as it was described
  pair.of_tachometer.gain_droop = 0.0;
  pair.of_tachometer.latency = 0.0;
  const auto status = run();
  EXPECT_EQ(status.phase(), job::JOB_DONE);
  EXPECT_THAT(status.text().c_str(), ::testing::HasSubstr("the fusion is as it was before"));
  EXPECT_LT(fused_rms("before"), 0.25e-3);  // an encoder of 2 mm alone: 0.58 mm
}

TEST_F(FusionTrialTest, SaysWhatIsMissing) {
  const auto status = run(false);
  EXPECT_EQ(status.phase(), job::JOB_FAILED);
  EXPECT_STREQ(status.text().c_str(), "no reading of the laser arrives: connect `reading` and `beam`");
}

}  // namespace
}  // namespace invar::calibration
