// LineFit: one displacement line while its repeats are being told from drift, reversal, jumps and outliers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"

namespace invar::metrology {

inline constexpr int drift_terms = 4;              // Legendre polynomials 1..4 of the time within a line
inline constexpr int nuisances = 1 + drift_terms;  // reversal first
inline constexpr double wide = 1e-3;  // m, sd of what is not known beforehand: offset, reversal, steps
inline constexpr int most_reversal_places = 20;  // a lost motion is smoother than an error
inline constexpr double expansion_sd = 2e-5;     // 1/K, beforehand: steel 1.2e-5, aluminium 2.3e-5

/// y = mean of its point + regressors * nuisance + noise.
struct LineFit {
  const DisplacementLine* line = nullptr;
  Beam beam;
  std::vector<int> point_of;
  std::vector<int> first_row;  // of each point
  std::vector<int> along;      // the points in their order along the beam
  double neighbours = 0.0;     // m, scale by which the means of neighbouring points differ
  Eigen::VectorXd y;           // reading minus nominal
  Eigen::MatrixXd regressors;  // rows x (reversal, drift, steps)
  std::vector<int> breaks;
  bool revisited = false;    // some point is read again after others: only that tells drift from place
  bool tells_drift = false;  // and in the same direction: only that tells drift from a reversal over the line
  /// The reversal over the line, by its values at places along the beam, straight in between. They are a constant (the first
  /// regressor), and `reversal_shape` times as many regressors from `first_shape` on, each of the same prior size.
  std::vector<double> reversal_places;  // m from the start
  Eigen::MatrixXd reversal_shape;
  int first_shape = 0;
  bool expanding = false;  // expansion is a regressor, after the drift
  double temperature = std::numeric_limits<double>::quiet_NaN();
  Eigen::VectorXd weights;
  Eigen::VectorXd nuisance;
  Eigen::MatrixXd nuisance_covariance;  // per unit noise variance
  Eigen::VectorXd residual;
  double scale = 0.0;
  double degrees = 0.0;

  [[nodiscard]] int rows() const { return static_cast<int>(y.size()); }
  [[nodiscard]] int points() const { return static_cast<int>(first_row.size()); }
};

/// Weighted least squares with a prior on the nuisance, from the weights and the scale as they stand.
void fit(LineFit& work, const Eigen::VectorXd& prior_variance);
/// Weights of Tukey's biweight at six scales: what lies further off counts nothing.
void tukey_weights(LineFit& work);
/// Prior variances [m^2] of nuisances that lines share.
struct NuisancePrior {
  std::array<double, drift_terms> drift{};  // by polynomial
  double reversal = 0.0;                    // of its waves over the line
};
/// Prior variances of the regressors.
Eigen::VectorXd prior_variances(const LineFit& work, const NuisancePrior& prior);
/// Scale, weights and nuisance from the line alone; jumps of the count become regressors. `floor` [m] bounds the scale.
void fit_robustly(LineFit& work, const NuisancePrior& prior, double floor);
/// Adds the regressors of a reversal that varies over the line, where its repeats tell one.
void add_reversal(LineFit& work);
/// Readings by the reversal's values at its places.
Eigen::MatrixXd reversal_rows(const LineFit& work);

}  // namespace invar::metrology
