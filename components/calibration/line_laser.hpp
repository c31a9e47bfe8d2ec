// LineLaser: the displacement laser of a cell as a job uses it - aligned, zeroed, averaged.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/component/component.hpp"
#include "core/job/job_host.hpp"
#include "idl/sensing.h"

namespace invar::calibration {

/// Ports `reading` and `beam` of its owner. Not real-time.
class LineLaser {
 public:
  /// `timeout`: the job fails when readings take longer [s]; outlives this.
  LineLaser(Component& owner, job::JobHost& host, const double& timeout);

  /// Aligns the beam and zeroes it where the tool stands.
  job::Task align(Eigen::Vector3d from, Eigen::Vector3d to);
  /// `mean`: of the next `count` readings that are taken after now [m]. Throws std::runtime_error.
  job::Task average(std::int64_t count, double& mean);
  /// Forgets the readings that nobody waits for.
  void drop_readings();

 private:
  Component& owner_;
  job::JobHost& host_;
  const double& timeout_;
  Inbox<sensing::DisplacementReading> reading_;
  Output<sensing::BeamCommand> beam_;
};

}  // namespace invar::calibration
