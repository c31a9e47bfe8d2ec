#include "core/metrology/camera/circle_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Points about their mean, in units of their RMS distance: the moments are then of order one.
struct Normalised {
  Matrix2Xd points;
  Vector2d mean;
  double scale;
};

std::optional<Normalised> normalise(Outline points) {
  if (points.cols() < 3 || !points.allFinite()) return std::nullopt;
  Normalised out{points, points.rowwise().mean(), 0.0};
  out.points.colwise() -= out.mean;
  out.scale = std::sqrt(out.points.squaredNorm() / static_cast<double>(points.cols()));
  if (!(out.scale > 0.0) || !std::isfinite(out.scale)) return std::nullopt;
  out.points /= out.scale;
  // Points on a line have no circle: the smaller principal moment vanishes.
  const Eigen::Matrix2d moment = out.points * out.points.transpose() / static_cast<double>(points.cols());
  if (numerics::symmetric_eigen(moment).values(0) < 1e-14) return std::nullopt;
  return out;
}

// A (x^2 + y^2) + B x + C y + D = 0 in normalised coordinates.
std::optional<Circle> from_algebraic(const Normalised& in, double a, double b, double c, double d) {
  const double square = (b * b + c * c) / (4.0 * a * a) - d / a;
  if (!(square > 0.0) || !std::isfinite(square)) return std::nullopt;
  return Circle{in.mean + in.scale * Vector2d{-0.5 * b / a, -0.5 * c / a}, in.scale * std::sqrt(square)};
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

VectorXd distances(Outline points, const Circle& circle) {
  return (points.colwise() - circle.center).colwise().norm().transpose().array() - circle.radius;
}

}  // namespace

std::optional<Circle> kasa_circle(Outline points) {
  const auto in = normalise(points);
  if (!in) return std::nullopt;
  const Index n = points.cols();
  Eigen::MatrixX3d design(n, 3);
  design.leftCols<2>() = in->points.transpose();
  design.col(2).setOnes();
  const VectorXd z = in->points.colwise().squaredNorm().transpose();
  const Vector3d solution = numerics::least_squares(design, -z);
  return from_algebraic(*in, 1.0, solution(0), solution(1), solution(2));
}

std::optional<Circle> pratt_circle(Outline points) {
  const auto in = normalise(points);
  if (!in) return std::nullopt;
  Eigen::Matrix4Xd rows(4, points.cols());
  rows.row(0) = in->points.colwise().squaredNorm();
  rows.middleRows<2>(1) = in->points;
  rows.row(3).setOnes();
  const Eigen::Matrix4d moment = rows * rows.transpose() / static_cast<double>(points.cols());
  // The inverse of the constraint matrix of B^2 + C^2 - 4 A D. One eigenvalue of the pencil is negative and
  // three are not (Sylvester): the second smallest is the fit.
  Eigen::Matrix4d inverse = Eigen::Matrix4d::Zero();
  inverse(0, 3) = inverse(3, 0) = -0.5;
  inverse(1, 1) = inverse(2, 2) = 1.0;
  const auto eigen = numerics::real_eigen(inverse * moment);
  if (!eigen) return std::nullopt;
  std::array<Index, 4> order{0, 1, 2, 3};
  const Eigen::Vector4d values = eigen->values;
  std::sort(order.begin(), order.end(), [&](Index i, Index j) { return values(i) < values(j); });
  const Eigen::Vector4d v = eigen->vectors.col(order[1]);
  return from_algebraic(*in, v(0), v(1), v(2), v(3));
}

std::optional<Circle> taubin_circle(Outline points) {
  const auto in = normalise(points);
  if (!in) return std::nullopt;
  // With mean(x) = mean(y) = 0 the constraint is 4 A^2 mean(z) + B^2 + C^2 = 1 and D = -A mean(z), z = x^2 +
  // y^2 (here mean(z) = 1): an ordinary eigenproblem in (2 A, B, C).
  Matrix3d moment;
  {
    Eigen::Matrix3Xd rows(3, points.cols());
    rows.row(0) = 0.5 * (in->points.colwise().squaredNorm().array() - 1.0);
    rows.bottomRows<2>() = in->points;
    moment = rows * rows.transpose() / static_cast<double>(points.cols());
  }
  const Vector3d v = numerics::symmetric_eigen(moment).vectors.col(0);
  return from_algebraic(*in, 0.5 * v(0), v(1), v(2), -0.5 * v(0));
}

std::optional<CircleFit> geometric_circle(Outline points, const Circle& start, const VectorXd& weights) {
  const Index n = points.cols();
  if (n < 3 || !points.allFinite() || !start.center.allFinite() || !(start.radius > 0.0)) return std::nullopt;
  const VectorXd weight = weights.size() == n ? weights : VectorXd::Ones(n);

  const auto cost = [&](const Circle& at) {
    return (weight.array() * distances(points, at).array().square()).sum();
  };
  CircleFit fit{start, Matrix3d::Zero(), weight, 0.0};
  Circle& at = fit.circle;
  double current = cost(at);
  double damping = 0.0;
  Matrix3d normal;
  bool converged = false;
  for (int iteration = 0; iteration < 100 && !converged; ++iteration) {
    Vector3d gradient = Vector3d::Zero();
    normal.setZero();
    for (Index i = 0; i < n; ++i) {
      const Vector2d delta = points.col(i) - at.center;
      const double distance = delta.norm();
      if (distance < 1e-12 * at.radius) continue;  // the centre itself has no direction to the circle
      const Vector3d jacobian{-delta(0) / distance, -delta(1) / distance, -1.0};
      gradient += weight(i) * (distance - at.radius) * jacobian;
      normal += weight(i) * jacobian * jacobian.transpose();
    }
    for (int attempt = 0;; ++attempt) {
      Matrix3d damped = normal;
      damped.diagonal() *= 1.0 + damping;
      const Vector3d step = numerics::solve_symmetric(damped, -gradient);
      if (!step.allFinite() || attempt > 30) return std::nullopt;
      const Circle next{at.center + step.head<2>(), at.radius + step(2)};
      const double there = cost(next);
      // Rounding of the cost itself must not count as a rise.
      if (next.radius > 0.0 && there <= current * (1.0 + 1e-12) + 1e-300) {
        converged = step.norm() < 1e-11 * at.radius;
        at = next;
        current = there;
        damping = damping < 1e-9 ? 0.0 : damping * 0.1;
        break;
      }
      if (step.norm() < 1e-9 * at.radius) {  // cannot get lower within rounding
        converged = true;
        break;
      }
      damping = std::max(1e-4, damping * 10.0);
    }
  }
  if (!converged) return std::nullopt;
  const double total = weight.sum();
  fit.residual_rms = total > 0.0 ? std::sqrt(current / total) : 0.0;
  const double freedom = total - 3.0;
  const double variance = freedom > 0.0 ? current / freedom : std::numeric_limits<double>::infinity();
  fit.covariance = variance * numerics::solve_symmetric(normal, Matrix3d::Identity());
  return fit;
}

std::optional<CircleFit> robust_circle(Outline points) {
  const auto start = taubin_circle(points);
  if (!start) return std::nullopt;
  Circle at = *start;
  const Index n = points.cols();
  VectorXd weight = VectorXd::Ones(n);
  std::optional<CircleFit> fit;
  for (int round = 0; round < 40; ++round) {
    const VectorXd distance = distances(points, at);
    const double mad = median([&] {
      std::vector<double> sizes(static_cast<std::size_t>(n));
      for (Index i = 0; i < n; ++i) sizes[static_cast<std::size_t>(i)] = std::abs(distance(i));
      return sizes;
    }());
    const double sigma = std::max(1.4826 * mad, 1e-12 * at.radius);
    // Cauchy never lets go of a point, so it finds the way; Tukey then drops what does not belong at all.
    const bool tukey = round >= 15;
    for (Index i = 0; i < n; ++i) {
      const double u = distance(i) / (sigma * (tukey ? 4.685 : 2.385));
      weight(i) = tukey ? (std::abs(u) < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0) : 1.0 / (1.0 + u * u);
    }
    fit = geometric_circle(points, at, weight);
    if (!fit) return std::nullopt;
    const double moved = (fit->circle.center - at.center).norm() + std::abs(fit->circle.radius - at.radius);
    at = fit->circle;
    if (tukey && moved < 1e-9 * at.radius) break;
  }
  return fit;
}

}  // namespace invar::metrology
