// ModelTransaction: a job's transaction on the compensation - models are put to use on trial, then kept or taken back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/component/component.hpp"
#include "core/job/job_host.hpp"
#include "idl/compensation.h"

namespace invar::calibration {

/// Ports `model` and `model_status` of its owner. Each task throws std::runtime_error where the compensation refuses or does not
/// answer. Not real-time.
class ModelTransaction {
 public:
  ModelTransaction(Component& owner, job::JobHost& host);

  /// Begins: `layers` empty takes out all models, "thermal" that of position and temperature.
  job::Task clear(const std::string& layers);
  /// Activates a model on trial and waits until its correction is blended in.
  job::Task use(const std::filesystem::path& model);
  /// Ends: the model on trial stays.
  job::Task keep();
  /// Ends with all as it was before, and throws std::runtime_error{why}.
  job::Task roll_back(const std::string& why);

  /// Once a step of a job: shows the compensation that the job lives. Throws std::runtime_error when the compensation no longer
  /// knows the transaction, restarted or rolled back by itself.
  void watch();
  /// Takes the trial back, where there is one; the job has ended.
  void abandon();
  /// A life of the owner begins: no transaction is known.
  void forget() { transaction_ = 0; }
  /// Checksum of the geometric model in use. Precondition: `clear` has ended.
  [[nodiscard]] std::uint32_t geometric_checksum() { return status_.latest()->geometric_checksum(); }

 private:
  job::Task command(compensation::ModelCommandKind kind, const std::string& path);
  std::uint64_t send(compensation::ModelCommandKind kind, const std::string& path);

  Component& owner_;
  job::JobHost& host_;
  Output<compensation::ModelCommand> model_;
  Input<compensation::ModelStatus> status_;
  std::uint64_t transaction_ = 0;  // ours on the compensation; 0: none
  bool known_ = false;             // the compensation has confirmed it
  Instant kept_at_;
};

}  // namespace invar::calibration
