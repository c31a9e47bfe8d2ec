// ThermalCalibration: the job that fits the error of one axis over position and temperature. It reads a line while the heater
// follows a trace. It compares the model with that of room temperature at points and temperatures that were not fitted.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/calibration/job_specs.hpp"
#include "components/calibration/line_laser.hpp"
#include "components/calibration/model_transaction.hpp"
#include "core/component/component.hpp"
#include "core/job/job_host.hpp"
#include "core/metrology/thermal/heat_trace.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "core/recording/table.hpp"
#include "idl/thermal.h"

namespace invar::calibration {

/// Ports `temperature`, `heater` and temperature_<zone> of its owner. Not real-time.
class ThermalCalibration {
 public:
  /// `zones`: further temperatures to record; outlive this.
  ThermalCalibration(Component& owner, job::JobHost& host, LineLaser& laser, ModelTransaction& models,
                     const std::vector<std::string>& zones);

  /// Files into job.out: thermal.csv, models_tried.txt, compensation.yaml, verify_fixed.csv, verify_varying.csv, and the model
  /// of room temperature in room/. Throws std::runtime_error and InputError with what a user can mend.
  job::Task run(const ThermalJob& job);
  /// Once a step, also without a job: what the temperature did, and the setpoint of the trace.
  void follow();
  /// The heater goes back to its setpoint before the job.
  void make_safe();
  /// A life of the owner begins: no temperature is known.
  void forget();

 private:
  struct Pass {
    const ThermalJob& job;
    bool between = false;  // at points in the middle between those that are fitted
    double number = 0.0;
    std::string model;  // in use meanwhile; empty: none
  };
  job::Task measure(const ThermalJob& job, recording::Table& table, std::size_t& cold_rows);
  void identify(const ThermalJob& job, const recording::Table& table, std::size_t cold_rows,
                std::array<std::filesystem::path, 2>& files);
  job::Task verify(const ThermalJob& job, const std::array<std::filesystem::path, 2>& files);
  job::Task reach(const ThermalJob& job, double temperature);
  job::Task pass(const Pass& what, recording::Table& table);  // `what` outlives it
  job::Task compare(const ThermalJob& job, const TraceSpec* trace,
                    const std::array<std::filesystem::path, 2>& files, recording::Table& table);
  [[nodiscard]] recording::Table heat_table(bool with_models) const;
  void set_heater(double setpoint);
  void remember(double at, double temperature);

  Component& owner_;
  job::JobHost& host_;
  LineLaser& laser_;
  ModelTransaction& models_;
  const std::vector<std::string>& zone_names_;
  Input<thermal::NodeTemperature> temperature_;
  Output<thermal::ThermalCommand> heater_;
  std::vector<std::unique_ptr<Input<thermal::NodeTemperature>>> zones_;

  metrology::HeatTrace heat_;
  metrology::ThermalReadings::History history_;
  const TraceSpec* trace_ = nullptr;  // that the heater follows
  Instant trace_start_;
  Instant began_;  // the job; times in its files count from here
  Instant set_at_;
  std::optional<double> setpoint_before_;  // of the heater, before the job
};

}  // namespace invar::calibration
