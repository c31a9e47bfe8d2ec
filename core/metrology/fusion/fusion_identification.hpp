// Identification of both fusion estimators from runs with a reference, and the choice between them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/metrology/fusion/fusion_runs.hpp"
#include "core/metrology/fusion/sensor_identification.hpp"
#include "core/metrology/fusion/weight_identification.hpp"

namespace invar::metrology {

struct FusionOptions {
  bool polynomial = false;       // try nonlinear fusion too
  bool noise_estimated = false;  // do not use noise_level
};

enum class FusionMethod { observer, weights };

/// One run as both methods fused it when it was held out; of a single run, as fused by what was fitted to it.
struct HeldOut {
  double speed = 0.0;        // RMS of the run [m/s]
  double noise_level = 0.0;  // as given or estimated
  double observer = 0.0;     // RMS error [m]
  double weights = 0.0;
  double best_single = 0.0;    // of the sensor that was best on it, known only in hindsight
  std::vector<double> fitted;  // weights that least squares gives this run, in the order of the sensors
};

struct FusionFit {
  FusionModel sensors;
  WeightModel weights;
  FusionMethod method = FusionMethod::observer;
  bool nothing_held_out = false;  // one run only: all errors here are those of the run that was fitted
  std::vector<HeldOut> held_out;
  double observer_rms = 0.0;  // over the held-out runs [m]
  double weights_rms = 0.0;
  double polynomial_rms = 0.0;      // the best order's; 0: not tried
  double noise_by_speed_rms = 0.0;  // weights with the noise from the speed; 0: not tried
  int degree = 1;
  std::vector<std::string> unidentified;
  std::vector<std::string> notes;
};

/// Both, three-fold cross-validated over whole runs; the method with the smaller held-out error is chosen. A further order of
/// the polynomial, and noise from the speed instead of a window, are taken only where their held-out error is smaller by
/// more than its own uncertainty.
FusionFit identify_fusion(const std::vector<FusionRun>& runs, const std::vector<std::string>& position_names,
                          const std::vector<std::string>& velocity_names, const FusionOptions& options);

}  // namespace invar::metrology
