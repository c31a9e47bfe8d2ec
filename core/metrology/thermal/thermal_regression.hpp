// ThermalRegression: thermal readings as one linear regression: terms over position, temperature and heating rate with a prior
// each, its evidence, and what it says of readings it was not given.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "core/metrology/thermal/lone_outliers.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "core/numerics/gaussian_prior.hpp"

namespace invar::metrology {

/// A term that is wanted: its factor and, for a zone's, which zone.
struct WantedTerm {
  WantedTerm(ThermalFactor f, std::size_t z = 0) : factor{f}, zone{z} {}  // NOLINT: a factor alone is meant
  ThermalFactor factor;
  std::size_t zone;
};
using WantedTerms = std::vector<WantedTerm>;

/// Hyperparameters by name, all logarithms: "noise", "length" of the geometry, "thermal_length" of all other functions of
/// x, "temperature_length", "rate_length", and a size for every factor.
using ThermalHyper = std::map<std::string, double>;

/// The readings at a time constant of the body behind the sensor (0: the sensor's temperature is the body's), and the fit of
/// any subset of terms to them. The readings must outlive it.
class ThermalRegression {
 public:
  ThermalRegression(const ThermalReadings& readings, double lag);

  void use(const WantedTerms& terms);
  void reweigh(const Eigen::VectorXd& weights);
  [[nodiscard]] numerics::Posterior fit(const ThermalHyper& hyper, numerics::Covariance covariance) const;
  /// Fills in what is missing of `hyper`, then maximises evidence and hyperprior over all that matter.
  void search(ThermalHyper& hyper, double step) const;
  /// Weights of zero for readings that stand alone beyond 4.5 standard deviations, one for the others: a stretch of
  /// readings beyond them is no outlier but something that the model lacks.
  [[nodiscard]] LoneOutliers judged(const Eigen::VectorXd& residual) const;
  /// A first robust fit with typical hyperparameters and Cauchy weights, for readings with gross outliers.
  void reject_outliers();
  [[nodiscard]] ThermalHyper typical() const;
  /// RMS of the residuals each reading would have if it had been left out.
  [[nodiscard]] double left_out_rms(const numerics::Posterior& p, double noise) const;
  /// RMS residual of each pass's readings by a fit without that pass (every fifth pass at a time). A pass goes from one
  /// turn of the axis to the next. Neighbours in time share the heat's error, so leaving out single readings flatters.
  [[nodiscard]] double held_out_rms(const ThermalHyper& hyper) const;
  /// Part of the residuals that neighbours in time share, RMS [m]. A hidden state makes such an error (a lag, a branch, another
  /// body's temperature), and noise does not. 0 where the part is no more than chance (three standard errors).
  [[nodiscard]] double unexplained(const numerics::Posterior& p) const;
  /// The model with its weights and its table of standard deviations, `unexplained` in them.
  [[nodiscard]] ThermalError model(const numerics::Posterior& p, double noise, double unexplained) const;

  [[nodiscard]] Eigen::VectorXd predicted(const numerics::Posterior& p) const { return rows_ * p.mean; }
  [[nodiscard]] const Eigen::VectorXd& weights() const { return weights_; }
  [[nodiscard]] const ThermalError& shape() const { return shape_; }
  [[nodiscard]] double scale() const { return scale_; }

 private:
  [[nodiscard]] Eigen::VectorXd basis(const ThermalState& at, double direction) const;
  [[nodiscard]] Eigen::VectorXd basis(Eigen::Index i) const;
  [[nodiscard]] std::array<ThermalState, 2> with_zones(const ThermalState& at) const;
  [[nodiscard]] std::vector<std::string> needed() const;
  [[nodiscard]] std::vector<Eigen::MatrixXd> prior(const ThermalHyper& hyper) const;

  const ThermalReadings& readings_;
  ThermalError shape_;
  Eigen::VectorXd temperature_;
  double scale_ = 1.0;
  std::vector<int> places_;  // of each reading
  int positions_ = 2;
  Eigen::VectorXd weights_;
  std::vector<ThermalTerm> terms_;
  Eigen::MatrixXd rows_;
  numerics::NormalEquations sums_;
};

}  // namespace invar::metrology
