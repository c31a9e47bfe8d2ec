// The job that identifies the sensors of an axis in the cell and puts their fusion to use.
#include "components/calibration/fusion_trial.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "components/fusion/fusion.hpp"
#include "components/interferometer/interferometer.hpp"
#include "components/world/simulated_sensor.hpp"
#include "core/compensation/fusion_file.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::calibration {
namespace {

const std::filesystem::path machines = std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / "machines";

/// Axis x of deployment/axis-trials.yaml, on an encoder of 2 mm and a tachometer that is late, reads too little and less
/// with speed, which nobody told the fusion.
class FusionTrialTest : public ::testing::Test {
 protected:
  static world::SimulatedStage::Parameters of_world() {
    world::SimulatedStage::Parameters p;
    p.machine = machines / "axis-trials.yaml";
    p.x.resolution = 2e-3;
    p.x.noise = 0.0;
    return p;
  }
  static stage::Stage::Parameters of_stage() {
    stage::Stage::Parameters p;
    p.travel = {-0.005, 0.205};
    p.control.kp = 380;
    p.control.ki = 2400;
    p.control.kd = 16;
    p.control.velocity_filter = 60;
    p.control.feedforward_velocity = 1.5;
    p.control.feedforward_acceleration = 0.2667;
    p.limits = {0.65, 5.0, 100.0};
    p.following_error = 0.05;
    return p;
  }
  FusionTrialTest() {
    of_tachometer.quantity = "velocity";
    of_tachometer.gain = 0.9;
    of_tachometer.latency = 0.004;
    of_tachometer.gain_droop = 0.3;
    of_tachometer.noise_level = 0.1;
    of_tachometer.largest = 0.21;
    of_fusion.sensors.resize(2);
    of_fusion.sensors[0].name = "encoder";
    of_fusion.sensors[0].from = "feedback";
    of_fusion.sensors[0].resolution = 2e-3;
    of_fusion.sensors[1].name = "tachometer";
    of_fusion.sensors[1].quantity = "velocity";
    of_fusion.sensors[1].largest = 0.21;
    of_trial.sensors = {{"encoder", "position", "feedback"}, {"tachometer", "velocity", "port"}};
    of_trial.jobs.resize(1);
    of_trial.jobs[0].name = "fuse";
    of_trial.jobs[0].periods = {2.0, 3.0, 4.5};
    of_trial.jobs[0].verify_periods = {2.5};
    of_trial.jobs[0].out = (folder / "fuse").string();
  }
  /// Runs the job to its end.
  job::JobStatus run(bool with_laser = true) {
    support::WiredAxis axis{of_world(), of_stage()};
    interferometer::Interferometer::Parameters of_laser;
    interferometer::Interferometer laser{of_laser};
    world::SimulatedSensor tachometer{of_tachometer};
    fusion::Fusion fusion{of_fusion};
    FusionTrial trial{of_trial};
    struct Operator final : Component {
      Output<job::JobCommand> job{*this, "job", "command"};
      Input<job::JobStatus> status{*this, "status", {.profile = "state"}};
      void step(const Tick&) noexcept override {}
    } human;
    auto& wired = axis.wired;
    wired.join(axis.world, "tool", laser, "tool");
    wired.join(axis.world, "truth_x", tachometer, "truth");
    wired.join(axis.world, "feedback_x", fusion, "feedback");
    wired.join(tachometer, "reading", fusion, "sensor_tachometer");
    wired.join(fusion, "fused", axis.stage, "fused");
    wired.join(fusion, "model_status", trial, "model_status");
    wired.join(axis.stage, "state", trial, "state");
    wired.join(axis.world, "feedback_x", trial, "feedback");
    wired.join(tachometer, "reading", trial, "sensor_tachometer");
    wired.join(fusion, "fused", trial, "fused");
    wired.join(trial, "model", fusion, "model");
    wired.join(trial, "command", axis.stage, "command");
    wired.join(trial, "beam", laser, "beam");
    if (with_laser) wired.join(laser, "reading", trial, "reading");
    wired.join(human, "job", trial, "job");
    wired.join(trial, "status", human, "status");
    for (Component* part :
         std::initializer_list<Component*>{&axis.world, &laser, &tachometer, &fusion, &axis.stage})
      wired.add(*part);
    wired.add(trial, 2);
    wired.add(human);
    wired.start();
    job::JobCommand command;
    command.id(1);
    command.name("fuse");
    human.job.write(command);
    for (int k = 0; k < 100'000; ++k) {
      wired.step();
      const auto* status = human.status.latest();
      if (status != nullptr && status->id() == 1 && status->phase() != job::JOB_RUNNING) return *status;
    }
    ADD_FAILURE() << "the job does not end";
    return {};
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
  world::SimulatedSensor::Parameters of_tachometer;
  fusion::Fusion::Parameters of_fusion;
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
  EXPECT_LT(fused_rms("after"), 0.8 * fused_rms("before"));
}

TEST_F(FusionTrialTest, SaysWhatIsMissing) {
  const auto status = run(false);
  EXPECT_EQ(status.phase(), job::JOB_FAILED);
  EXPECT_STREQ(status.text().c_str(), "no reading of the laser arrives: connect `reading` and `beam`");
}

}  // namespace
}  // namespace invar::calibration
