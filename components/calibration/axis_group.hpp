// AxisGroup: the axes of a machine, which jobs move together.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "components/calibration/job_axis.hpp"
#include "core/job/job_host.hpp"

namespace invar::calibration {

/// Ports state_x, command_x, state_y ... of its owner. Not real-time.
class AxisGroup {
 public:
  struct Settings {
    std::int64_t axes = 2;
    const double& settle_timeout;  // s
    const double& velocity;        // of the moves [m/s]; 0: the stage's own
  };
  AxisGroup(Component& owner, job::JobHost& host, const Settings& settings);

  /// Every axis enabled, or std::runtime_error.
  job::Task enable();
  /// All axes, each with its share of the pace, so that the path is straight; until they have settled there, or
  /// std::runtime_error.
  job::Task move_to(Eigen::Vector3d target, job::Pace pace);
  /// Every axis is told to stop.
  void stop();

 private:
  void send(std::size_t axis, stage::AxisCommandKind kind, double position = 0.0, const job::Pace& pace = {});
  void begin_move(const Eigen::Vector3d& target, const job::Pace& pace);
  [[nodiscard]] std::string unsettled() const;

  Component& owner_;
  job::JobHost& host_;
  Settings settings_;
  std::vector<std::unique_ptr<JobAxis>> axes_;
};

}  // namespace invar::calibration
