// Identification of the thesis's weights from runs: least squares in each cell of the selectors, then a network over
// them.
#pragma once

#include <vector>

#include "core/metrology/fusion/fusion_runs.hpp"
#include "core/metrology/fusion/weighted_fusion.hpp"

namespace invar::metrology {

struct WeightOptions {
  int degree = 1;               // of nonlinear fusion
  std::vector<double> delays;   // of all sensors [s]; empty: none
  bool noise_by_speed = false;  // estimate the noise from the speed; otherwise over a window of readings
};

/// A run is a cell of the selectors: (typical speed, noise level, and its further attribute where all runs have one).
WeightModel identify_weights(const std::vector<FusionRun>& runs, const WeightOptions& options = {});

/// Noise of the first velocity sensor over speed: the median of windows in bins of speed, made monotone (pool adjacent
/// violators) in the direction that fits better.
NoiseBySpeed identify_noise_by_speed(const std::vector<FusionRun>& runs);

/// The selectors of a run.
Eigen::VectorXd selectors_of(const FusionRun& run);

}  // namespace invar::metrology
