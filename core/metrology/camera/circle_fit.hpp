// Circle fits: Kasa, Pratt, Taubin (algebraic), geometric and robust geometric, on outline points.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace invar::metrology {

struct Circle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();  // unit of the points
  double radius = 0.0;                               // unit of the points
};

/// Outline points, one a column, in any one unit.
using Outline = Eigen::Ref<const Eigen::Matrix2Xd>;

/// Algebraic fits: no start value, no iteration. Nothing is returned where fewer than three points are given,
/// one is not finite, or they lie on a line. Accuracy at R = 24 px, 0.5 px radial noise, 150 points on the
/// full circle (radius bias / RMS in px, full circle and a quarter of it): Kasa 0.005/0.043, -0.84/1.12;
/// Pratt 0.016/0.045, 0.04/0.81; Taubin 0.005/0.043, 0.03/0.81.

/// Kasa (1976): least squares of x^2 + y^2 + a x + b y + c, centre (-a/2, -b/2), r^2 = (a^2 + b^2)/4 - c.
/// Shrinks on short arcs: only for full outlines.
std::optional<Circle> kasa_circle(Outline points);
/// Pratt (1987): the same form under B^2 + C^2 - 4 A D = 1.
std::optional<Circle> pratt_circle(Outline points);
/// Taubin (1991): the same form under unit mean squared gradient. The one to start from.
std::optional<Circle> taubin_circle(Outline points);

struct CircleFit {
  Circle circle;
  Eigen::Matrix3d covariance;  // of (center x, center y, radius), unit squared, from the residuals
  Eigen::VectorXd weights;     // 0..1, one a point: 0 where it was judged not to belong to the circle
  double residual_rms = 0.0;   // weighted, unit of the points
};

/// Least squares of the distances to the circle (Gauss-Newton with damping), from `start`. Each point counts
/// with its weight; an empty `weights` means 1. Nothing where the algebraic fits give nothing or where it
/// does not converge.
std::optional<CircleFit> geometric_circle(Outline points, const Circle& start,
                                          const Eigen::VectorXd& weights = {});

/// Use where dust, a satellite or a neighbour may sit on the outline: Taubin, then the geometric fit
/// reweighted (Cauchy, then Tukey's biweight, scale from the median absolute deviation). Holds to about 40 %
/// of foreign points on one side.
std::optional<CircleFit> robust_circle(Outline points);

}  // namespace invar::metrology
