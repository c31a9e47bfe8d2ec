// GeometricCalibration: the job that measures lines, fits the geometric error and keeps the model where it helps on lines that
// were not fitted.
#pragma once

#include <cstdint>

#include "components/calibration/job_specs.hpp"
#include "components/calibration/line_laser.hpp"
#include "components/calibration/model_transaction.hpp"
#include "core/job/job_host.hpp"
#include "core/recording/table.hpp"

namespace invar::calibration {

/// Not real-time.
class GeometricCalibration {
 public:
  GeometricCalibration(job::JobHost& host, LineLaser& laser, ModelTransaction& models)
      : host_{host}, laser_{laser}, models_{models} {}

  /// Files into job.out: verify_before.csv, lines.csv, compensation.yaml, verify_after.csv. Throws std::runtime_error and
  /// InputError with what a user can mend.
  job::Task run(const GeometricJob& job);

 private:
  /// How a line is measured.
  struct Way {
    double interval = 0.01;  // m, between its points
    std::int64_t cycles = 1;
    std::int64_t readings = 4;  // at each point
    double share = 0.0;         // of the whole job
  };
  job::Task measure(const LineSpec& line, const Way& how, recording::Table& table);  // `how` outlives it

  job::JobHost& host_;
  LineLaser& laser_;
  ModelTransaction& models_;
  double progress_ = 0.0;
};

}  // namespace invar::calibration
