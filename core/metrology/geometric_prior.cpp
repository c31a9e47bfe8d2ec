#include "core/metrology/geometric_prior.hpp"

#include <cmath>

namespace invar::metrology {

namespace {

std::size_t index(MotionKind kind) { return static_cast<std::size_t>(kind); }

/// Correlation (1 + s + s^2/3) exp(-s), s = sqrt(5) r / length, and its derivative by log length.
struct Matern {
  double value;
  double slope;
};
Matern matern52(double distance, double length) {
  const double s = std::sqrt(5.0) * distance / length;
  const double fall = std::exp(-s);
  return {(1.0 + s + s * s / 3.0) * fall, s * s * (1.0 + s) / 3.0 * fall};
}

constexpr double nugget = 1e-7;  // of the variance: keeps long lengths well conditioned
constexpr double offset = 10.0;  // in amplitudes; the gauge takes the offset away again

}  // namespace

MotionKind kind_of(int component) {
  if (is_rotation(component)) return MotionKind::angle;
  return is_positioning(component) ? MotionKind::positioning : MotionKind::straightness;
}

Eigen::MatrixXd coefficient_covariance(const GeometricBasis& basis, const GeometricPrior& prior,
                                       int component) {
  const auto axis = static_cast<std::size_t>(axis_of(component));
  const auto& spline = basis.splines[axis];
  const MotionKind kind = kind_of(component);
  const double variance = prior.amplitude[index(kind)] * prior.amplitude[index(kind)];
  const double width = spline.interval().width();
  const double slope = kind == MotionKind::positioning ? prior.positioning_slope * width
                                                       : prior.angle_slope * prior.amplitude[index(kind)];
  Eigen::MatrixXd covariance(spline.size(), spline.size());
  for (int i = 0; i < spline.size(); ++i) {
    for (int j = 0; j <= i; ++j) {
      const double gi = (spline.place(i) - basis.origin[axis]) / width;
      const double gj = (spline.place(j) - basis.origin[axis]) / width;
      const double distance = spline.place(i) - spline.place(j);
      covariance(i, j) = covariance(j, i) = variance * matern52(distance, prior.length[index(kind)]).value +
                                            slope * slope * gi * gj + offset * offset * variance;
    }
    covariance(i, i) += nugget * variance;
  }
  return covariance;
}

CovarianceSlopes coefficient_covariance_slopes(const GeometricBasis& basis, const GeometricPrior& prior,
                                               int component) {
  const auto axis = static_cast<std::size_t>(axis_of(component));
  const auto& spline = basis.splines[axis];
  const MotionKind kind = kind_of(component);
  const double variance = prior.amplitude[index(kind)] * prior.amplitude[index(kind)];
  CovarianceSlopes slopes;
  slopes.by_amplitude = 2.0 * coefficient_covariance(basis, prior, component);
  slopes.by_length.resize(spline.size(), spline.size());
  const double width = spline.interval().width();
  const double fixed = kind == MotionKind::positioning ? prior.positioning_slope * width : 0.0;
  for (int i = 0; i < spline.size(); ++i) {
    for (int j = 0; j <= i; ++j) {
      const double distance = spline.place(i) - spline.place(j);
      const double by_length = variance * matern52(distance, prior.length[index(kind)]).slope;
      slopes.by_length(i, j) = slopes.by_length(j, i) = by_length;
    }
    for (int j = 0; j < spline.size(); ++j)  // the slope of positioning does not scale with the amplitude
      slopes.by_amplitude(i, j) -= 2.0 * fixed * fixed * (spline.place(i) - basis.origin[axis]) *
                                   (spline.place(j) - basis.origin[axis]) / (width * width);
  }
  return slopes;
}

}  // namespace invar::metrology
