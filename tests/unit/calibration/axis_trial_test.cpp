// The jobs of an axis on simulated devices: what the ripple's feedforward and the fused position are worth.
#include "components/calibration/axis_trial.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>

#include "components/fusion/fusion.hpp"
#include "components/interferometer/interferometer.hpp"
#include "components/world/simulated_sensor.hpp"
#include "core/model/model_file.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::calibration {
namespace {

const std::filesystem::path machines = std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / "machines";

struct Operator final : Component {
  Output<job::JobCommand> job{*this, "job", "command"};
  Input<job::JobStatus> status{*this, "status", {.profile = "state"}};
  void step(const Tick&) noexcept override {}
};

/// One axis with a laser along it and the trial, which is stepped at 500 Hz.
struct Cell {
  Cell(world::SimulatedStage::Parameters world_parameters, stage::Stage::Parameters stage_parameters,
       AxisTrial::Parameters trial_parameters)
      : axis{std::move(world_parameters), std::move(stage_parameters)},
        of_trial{std::move(trial_parameters)} {
    wired.join(axis.world, "tool", laser, "tool");
    wired.join(axis.stage, "state", trial, "state");
    wired.join(axis.stage, "model_status", trial, "model_status");
    wired.join(trial, "model", axis.stage, "model");
    wired.join(trial, "command", axis.stage, "command");
    wired.join(trial, "beam", laser, "beam");
    wired.join(laser, "reading", trial, "reading");
    wired.join(human, "job", trial, "job");
    wired.join(trial, "status", human, "status");
  }
  void bring_up() {
    wired.add(axis.world);
    wired.add(laser);
    for (Component* component : between) wired.add(*component);
    wired.add(axis.stage);
    wired.add(trial, 2);
    wired.add(human);
    wired.start();
  }
  /// Runs a job to its end and returns what it said.
  job::JobStatus run(const std::string& name) {
    job::JobCommand command;
    command.id(next++);
    command.name(name);
    human.job.write(command);
    for (int k = 0; k < 400'000; ++k) {
      wired.step();
      const auto* status = human.status.latest();
      if (status != nullptr && status->id() == command.id() && status->phase() != job::JOB_RUNNING)
        return *status;
    }
    ADD_FAILURE() << "the job does not end";
    return {};
  }

  support::WiredAxis axis;
  support::Wired& wired = axis.wired;
  AxisTrial::Parameters of_trial;
  interferometer::Interferometer::Parameters of_laser;
  interferometer::Interferometer laser{of_laser};
  std::vector<Component*> between;
  AxisTrial trial{of_trial};
  Operator human;
  std::uint64_t next = 1;
};

world::SimulatedStage::Parameters world_parameters() {
  world::SimulatedStage::Parameters p;
  p.machine = machines / "axis-trials.yaml";
  return p;
}

TEST(AxisTrial, IdentifiesTheRippleAndLowersTheFollowingErrorOfRunsNotFitted) {
  auto of_world = world_parameters();
  of_world.z.model = (machines / "axis-rippled.yaml").string();
  stage::Stage::Parameters of_stage;
  of_stage.axis = 2;
  of_stage.control.ki = 8e5;
  of_stage.model = machines / "axis-nominal.yaml";
  AxisTrial::Parameters of_trial;
  of_trial.axis = 2;
  const invar::testing::TemporaryFolder folder;
  const auto out = folder / "ripple";
  of_trial.ripple.resize(1);
  of_trial.ripple[0].name = "ripple";
  of_trial.ripple[0].model = machines / "axis-nominal.yaml";
  of_trial.ripple[0].from = 0.01;
  of_trial.ripple[0].to = 0.19;
  of_trial.ripple[0].out = out.string();
  Cell cell{of_world, of_stage, of_trial};
  cell.bring_up();
  const auto status = cell.run("ripple");
  EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  std::cout << status.text().c_str() << '\n';
  const auto model = model::load(out / "patched.yaml");
  ASSERT_GE(model.terms.size(), 2U);
  EXPECT_NEAR(model.terms[0].values[0], 2.4, 0.1);  // the truth in axis-rippled.yaml
  EXPECT_NEAR(model.terms[0].values[1], 0.0317, 3e-5);
  const auto rms = [&](const char* file) {
    const auto table = recording::Table::read(out / file);
    const auto error = table.in("following_error", "m"), reference = table.in("reference", "m");
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < error.size(); ++i) {
      if (reference[i] < 0.03 || reference[i] > 0.17) continue;
      sum += error[i] * error[i];
      ++count;
    }
    return std::sqrt(sum / count);
  };
  EXPECT_LT(rms("ripple_after.csv"), 0.5 * rms("ripple_before.csv"));
}

TEST(AxisTrial, FusedTrackingBeatsTheEncoderAlone) {
  double rms[2];
  for (const bool fused : {false, true}) {
    auto of_world = world_parameters();
    of_world.x.resolution = 2e-3;
    of_world.x.noise = 0.0;
    stage::Stage::Parameters of_stage;
    of_stage.travel = {-0.005, 0.205};
    of_stage.control.kp = 380;
    of_stage.control.ki = 2400;
    of_stage.control.kd = 16;
    of_stage.control.velocity_filter = 60;
    of_stage.control.feedforward_velocity = 1.5;
    of_stage.control.feedforward_acceleration = 0.2667;
    of_stage.limits = {0.65, 5.0, 100.0};
    of_stage.following_error = 0.05;
    AxisTrial::Parameters of_trial;
    const invar::testing::TemporaryFolder folder;
    const auto out = folder / "tracking";
    of_trial.tracking.resize(1);
    of_trial.tracking[0].name = "track";
    of_trial.tracking[0].periods = {3.0};
    of_trial.tracking[0].out = out.string();
    Cell cell{of_world, of_stage, of_trial};
    world::SimulatedSensor::Parameters of_tachometer;
    of_tachometer.quantity = "velocity";
    of_tachometer.latency = 0.003;
    of_tachometer.noise_level = 0.2;
    of_tachometer.largest = 0.21;
    world::SimulatedSensor tachometer{of_tachometer};
    fusion::Fusion::Parameters of_fusion;
    of_fusion.sensors.resize(2);
    of_fusion.sensors[0].name = "encoder";
    of_fusion.sensors[0].from = "feedback";
    of_fusion.sensors[0].resolution = 2e-3;
    of_fusion.sensors[1].name = "tachometer";
    of_fusion.sensors[1].quantity = "velocity";
    of_fusion.sensors[1].largest = 0.21;
    of_fusion.sensors[1].delay_sigma = 0.005;
    fusion::Fusion fusion{of_fusion};
    if (fused) {
      cell.wired.join(cell.axis.world, "truth_x", tachometer, "truth");
      cell.wired.join(tachometer, "reading", fusion, "sensor_tachometer");
      cell.wired.join(cell.axis.world, "feedback_x", fusion, "feedback");
      cell.wired.join(fusion, "fused", cell.axis.stage, "fused");
      cell.between = {&tachometer, &fusion};
    }
    cell.bring_up();
    const auto status = cell.run("track");
    EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
    std::cout << (fused ? "fused: " : "encoder: ") << status.text().c_str() << '\n';
    const auto table = recording::Table::read(out / "tracking.csv");
    const auto laser = table.in("laser", "m"), reference = table.in("reference", "m");
    double sum = 0.0, mean = 0.0, count = 0.0;
    for (std::size_t i = 0; i < laser.size(); ++i)
      if (std::isfinite(laser[i])) {
        mean += laser[i] - reference[i];
        sum += std::pow(laser[i] - reference[i], 2);
        count += 1.0;
      }
    rms[fused ? 1 : 0] = std::sqrt(sum / count - std::pow(mean / count, 2));
  }
  EXPECT_LT(rms[1], 0.5 * rms[0]);
}

TEST(AxisTrial, SaysWhyAJobCannotRun) {
  AxisTrial::Parameters of_trial;
  of_trial.tracking.resize(1);
  of_trial.tracking[0].name = "track";
  const invar::testing::TemporaryFolder folder;
  of_trial.tracking[0].out = (folder / "fails").string();
  stage::Stage::Parameters of_stage;  // no more than 0.1 m/s
  Cell cell{world_parameters(), of_stage, of_trial};
  cell.bring_up();
  EXPECT_STREQ(cell.run("nonsense").text().c_str(), "`nonsense` is no job of this component");
  const auto status = cell.run("track");
  EXPECT_EQ(status.phase(), job::JOB_FAILED);
  EXPECT_STREQ(status.text().c_str(), "the axis refused a motion of the job");
}

}  // namespace
}  // namespace invar::calibration
