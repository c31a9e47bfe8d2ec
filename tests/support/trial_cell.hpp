// TrialCell: one axis with a laser along it, a component that runs jobs on it, and who asks for them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "components/fusion/fusion.hpp"
#include "components/interferometer/interferometer.hpp"
#include "components/world/simulated_sensor.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::support {

inline const std::filesystem::path machines =
    std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / "machines";

/// Axes without what deployment/axis-trials.yaml hides.
inline world::SimulatedStage::Parameters trial_world() {
  world::SimulatedStage::Parameters p;
  p.machine = machines / "axis-trials.yaml";
  return p;
}

/// X on an encoder of 2 mm.
inline world::SimulatedStage::Parameters coarse_world() {
  auto p = trial_world();
  p.x.resolution = 2e-3;
  p.x.noise = 0.0;
  return p;
}

/// A servo that suits such an encoder.
inline stage::Stage::Parameters coarse_stage() {
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

/// A tachometer beside that encoder and their fusion, which the stage follows.
struct FusedTachometer {
  FusedTachometer() {
    of_tachometer.quantity = "velocity";
    of_tachometer.largest = 0.21;
    of_fusion.sensors.resize(2);
    of_fusion.sensors[0].name = "encoder";
    of_fusion.sensors[0].from = "feedback";
    of_fusion.sensors[0].resolution = 2e-3;
    of_fusion.sensors[1].name = "tachometer";
    of_fusion.sensors[1].quantity = "velocity";
    of_fusion.sensors[1].largest = 0.21;
  }
  world::SimulatedSensor::Parameters of_tachometer;
  fusion::Fusion::Parameters of_fusion;
};
class FusedX {
 public:
  /// Joins and adds them; the world was added before.
  FusedX(WiredAxis& axis, FusedTachometer of_) : of{std::move(of_)} {
    axis.wired.join(axis.world, "truth_x", tachometer, "truth");
    axis.wired.join(axis.world, "feedback_x", fusion, "feedback");
    axis.wired.join(tachometer, "reading", fusion, "sensor_tachometer");
    axis.wired.join(fusion, "fused", axis.stage, "fused");
    axis.wired.add(tachometer);
    axis.wired.add(fusion);
  }

  FusedTachometer of;
  world::SimulatedSensor tachometer{of.of_tachometer};
  fusion::Fusion fusion{of.of_fusion};
};

struct Operator final : Component {
  Output<job::JobCommand> job{*this, "job", "command"};
  Input<job::JobStatus> status{*this, "status", {.profile = "state"}};
  void step(const Tick&) noexcept override {}
};

/// `Trial` is stepped at 500 Hz. What comes between world and stage is added between construction and `bring_up`.
template <class Trial>
class TrialCell {
 public:
  TrialCell(world::SimulatedStage::Parameters of_world, stage::Stage::Parameters of_stage,
            typename Trial::Parameters of_trial_, bool laser_reads = true)
      : axis{std::move(of_world), std::move(of_stage)}, of_trial{std::move(of_trial_)} {
    wired.join(axis.world, "tool", laser, "tool");
    wired.join(axis.stage, "state", trial, "state");
    wired.join(trial, "command", axis.stage, "command");
    wired.join(trial, "beam", laser, "beam");
    if (laser_reads) wired.join(laser, "reading", trial, "reading");
    wired.join(human, "job", trial, "job");
    wired.join(trial, "status", human, "status");
    wired.add(axis.world);
    wired.add(laser);
  }
  /// A trial that finds out what the sensors of `fused` are hears them, and gives their fusion what it found.
  void join(FusedX& fused) {
    wired.join(axis.world, "feedback_x", trial, "feedback");
    wired.join(fused.tachometer, "reading", trial, "sensor_tachometer");
    wired.join(fused.fusion, "fused", trial, "fused");
    wired.join(fused.fusion, "model_status", trial, "model_status");
    wired.join(trial, "model", fused.fusion, "model");
  }
  void bring_up() {
    wired.add(axis.stage);
    wired.add(trial, 2);
    wired.add(human);
    wired.start();
  }
  /// Runs a job to its end and returns what it said.
  job::JobStatus run(const std::string& name, const std::string& arguments = {}) {
    job::JobCommand command;
    command.id(next++);
    command.name(name);
    command.arguments(arguments);
    human.job.write(command);
    for (int k = 0; k < 400'000; ++k) {
      wired.step();
      const auto* status = human.status.latest();
      if (status != nullptr && status->id() == command.id() && status->phase() != job::JOB_RUNNING)
        return *status;
    }
    throw std::logic_error{"the job does not end"};
  }

  WiredAxis axis;
  Wired& wired = axis.wired;
  typename Trial::Parameters of_trial;
  interferometer::Interferometer::Parameters of_laser;
  interferometer::Interferometer laser{of_laser};
  Trial trial{of_trial};
  Operator human;
  std::uint64_t next = 1;
};

}  // namespace invar::support
