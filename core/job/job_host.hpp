// JobHost: what the jobs of this room ask of the component that runs them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "core/job/task.hpp"

namespace invar::job {

/// Along the path, whatever its direction; 0: the stage's own.
struct Pace {
  double velocity = 0.0;      // m/s
  double acceleration = 0.0;  // m/s2
  double jerk = 0.0;          // m/s3
};

class JobHost {
 public:
  virtual ~JobHost() = default;
  /// Every axis enabled, or std::runtime_error.
  virtual Task enable_axes() = 0;
  /// Straight to `target`, where the axes take the pace, and settled there, or std::runtime_error.
  virtual Task move_to(Eigen::Vector3d target, Pace pace) = 0;
  /// Reports the present activity of the job and its share of the whole.
  virtual void tell(const std::string& text, double progress) = 0;
  /// The job's share that is done, for its next report.
  virtual void advance(double progress) = 0;
  /// A number for a command, never given before.
  virtual std::uint64_t next_id() = 0;
};

}  // namespace invar::job
