#include "components/vision/ruler.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "components/vision/blobs.hpp"

namespace invar::vision {

namespace {

using Eigen::Index;
using Eigen::Vector2d;

struct Circle {
  Shape shape;              // px, corrected for blur
  Eigen::Matrix2Xd edges;   // px, corrected for blur
  Eigen::VectorXd weights;  // 0..1
  double residual = 0.0;    // px
};

// The edge points of a refined outline, pushed outward by what the blur pulls them in.
Circle make_circle(const Shape& sought, const OutlineFit& fit, const Rays& rays) {
  Circle circle;
  circle.shape = fit.shape;
  circle.residual = fit.residual;
  const double push = fit.blur * fit.blur / (2.0 * fit.shape.radius);
  circle.shape.radius += push;
  circle.edges.resize(2, rays.count);
  circle.weights.resize(rays.count);
  for (int i = 0; i < rays.count; ++i) {
    const double angle = ray_angle(rays, i);
    const Vector2d direction{std::cos(angle), std::sin(angle)};
    const double radius =
        sought.radius + sought.cos2 * std::cos(2.0 * angle) + sought.sin2 * std::sin(2.0 * angle);
    const auto k = static_cast<std::size_t>(i);
    circle.edges.col(i) = Vector2d{sought.x, sought.y} + (radius + rays.offset[k] + push) * direction;
    circle.weights(i) = rays.open[k] ? rays.weight[k] : 0.0;
  }
  return circle;
}

std::vector<Circle> find_circles(const cv::Mat& image) {
  // A ruler's circles are few, large and of different sizes: a wide window, and reduced so far that dust is gone.
  DetectionOptions options;
  options.window = 12;
  options.level = 0;
  while (std::min(image.cols, image.rows) >> (options.level + 1) >= 150) ++options.level;
  const Detection found = detect(image, options);
  std::vector<Circle> circles;
  for (const Candidate& candidate : found.candidates) {
    Shape shape{candidate.x, candidate.y, candidate.radius, 0.0, 0.0};
    Rays rays;
    rays.choose(shape.radius);
    OutlineFit fit =
        seek_outline(image, shape, found.polarity, std::clamp(0.25 * shape.radius, 3.0, 14.0), rays);
    if (!fit.valid || fit.coverage < 0.6 || shape.radius < 5.0) continue;
    shape = fit.shape;
    double blur = 1.5;
    Shape sought = shape;
    for (int round = 0; round < 5; ++round) {
      sought = shape;
      const EdgeFilter filter{blur, EdgeFilter::half_for(std::max(1.5, blur), shape.radius)};
      fit = refine_outline(image, sought, found.polarity, filter, rays);
      if (!fit.valid) break;
      shape = fit.shape;
      blur = std::clamp(fit.blur, 0.4, 4.0);
    }
    const bool whole = fit.valid && fit.support > 0.75 && fit.coverage > 0.75 && fit.shape.axis_ratio() > 0.9;
    const bool twice = std::any_of(circles.begin(), circles.end(), [&](const Circle& c) {
      return std::hypot(c.shape.x - shape.x, c.shape.y - shape.y) <
             0.5 * std::max(shape.radius, c.shape.radius);
    });
    if (whole && !twice) circles.push_back(make_circle(sought, fit, rays));
  }
  return circles;
}

// Gauss-Newton over 1/scale [px/m], distortion, aspect and the centres (ideal px). `free` tells which of the first three move.
struct Joint {
  double per_metre = 0.0, distortion = 0.0, aspect = 1.0;
  std::vector<Vector2d> centers;
  double chi = 0.0;  // sum of weighted squares, px^2
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

Joint solve(const std::vector<Circle>& circles, const std::vector<double>& radii, const Vector2d& middle,
            bool free_distortion, bool free_aspect) {
  const Index n = static_cast<Index>(circles.size()), size = 3 + 2 * n;
  const double unit = 1.0 / (middle.squaredNorm() + 1.0);  // distortion in shares at the corner: well scaled
  Joint at;
  double share = 0.0;
  double measured = 0.0, known = 0.0;
  for (std::size_t j = 0; j < circles.size(); ++j) {
    measured += circles[j].shape.radius * radii[j];
    known += radii[j] * radii[j];
    at.centers.emplace_back(circles[j].shape.x, circles[j].shape.y);
  }
  at.per_metre = measured / known;
  const double size_unit = at.per_metre;
  double relative = 1.0;  // per_metre in units of the start
  Eigen::MatrixXd normal;
  double weight_sum = 0.0;
  for (int round = 0; round < 20; ++round) {
    normal = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    at.chi = weight_sum = 0.0;
    for (Index j = 0; j < n; ++j) {
      const Circle& circle = circles[static_cast<std::size_t>(j)];
      const Vector2d center = at.centers[static_cast<std::size_t>(j)];
      const double radius = size_unit * relative * radii[static_cast<std::size_t>(j)];
      for (Index i = 0; i < circle.edges.cols(); ++i) {
        const double w = circle.weights(i);
        if (!(w > 0.0)) continue;
        const Vector2d away = circle.edges.col(i) - middle;
        const double square = away.squaredNorm();
        Vector2d delta = away * (1.0 + unit * share * square) - center + middle;
        delta.y() *= at.aspect;
        const double distance = delta.norm();
        const Vector2d direction = delta / distance;
        const double residual = distance - radius;
        Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
        row(0) = -size_unit * radii[static_cast<std::size_t>(j)];
        if (free_distortion)
          row(1) = unit * square * (direction.x() * away.x() + direction.y() * at.aspect * away.y());
        if (free_aspect) row(2) = direction.y() * delta.y() / at.aspect;
        row(3 + 2 * j) = -direction.x();
        row(4 + 2 * j) = -direction.y() * at.aspect;
        normal += w * row * row.transpose();
        right -= w * residual * row;
        at.chi += w * residual * residual;
        weight_sum += w;
      }
    }
    if (!free_distortion) normal(1, 1) = 1.0;
    if (!free_aspect) normal(2, 2) = 1.0;
    const Eigen::VectorXd step = normal.ldlt().solve(right);
    relative += step(0);
    share += step(1);
    at.aspect += step(2);
    for (Index j = 0; j < n; ++j) at.centers[static_cast<std::size_t>(j)] += step.segment<2>(3 + 2 * j);
    if (step.head<3>().norm() < 1e-12) break;
  }
  at.per_metre = size_unit * relative;
  at.distortion = unit * share;
  const double freedom = std::max(1.0, weight_sum - static_cast<double>(size));
  Eigen::MatrixXd inverse = normal.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  // Neighbouring rays share pixels, and what remains of an edge's shape is common to a circle: the residuals are
  // not independent. A correlation over four rays is what simulated pictures show.
  at.covariance = 4.0 * at.chi / freedom * inverse.topLeftCorner<3, 3>();
  at.covariance.row(0) *= size_unit, at.covariance.col(0) *= size_unit;
  at.covariance.row(1) *= unit, at.covariance.col(1) *= unit;
  if (!free_distortion) at.covariance.row(1).setZero(), at.covariance.col(1).setZero();
  if (!free_aspect) at.covariance.row(2).setZero(), at.covariance.col(2).setZero();
  return at;
}

}  // namespace

std::optional<RulerFit> calibrate_ruler(const cv::Mat& image, const std::vector<double>& radii,
                                        RulerFailure& failure) {
  std::vector<Circle> circles = find_circles(image);
  const std::size_t n = radii.size();
  std::sort(circles.begin(), circles.end(),
            [](const Circle& a, const Circle& b) { return a.shape.radius > b.shape.radius; });
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return radii[a] > radii[b]; });
  // Specks that look round are smaller than any circle of a ruler.
  if (circles.size() > n && !circles.empty()) {
    const double smallest = circles.front().shape.radius * radii[order.back()] / radii[order.front()];
    std::erase_if(circles, [&](const Circle& c) { return c.shape.radius < 0.8 * smallest; });
  }
  if (circles.size() != n) {
    failure.what = "shows " + std::to_string(circles.size()) +
                   (circles.size() == 1 ? " circle" : " circles") + ", the ruler has " + std::to_string(n);
    return std::nullopt;
  }
  std::vector<double> sorted(n);
  for (std::size_t i = 0; i < n; ++i) sorted[i] = radii[order[i]];
  const Vector2d middle{0.5 * (image.cols - 1), 0.5 * (image.rows - 1)};

  Joint best = solve(circles, sorted, middle, false, false);
  for (std::size_t i = 0; i < n; ++i) {
    const double expected = best.per_metre * sorted[i];
    if (std::abs(circles[i].shape.radius / expected - 1.0) > 0.03) {
      failure.what = "the circles' sizes do not match the ruler: one has " +
                     std::to_string(circles[i].shape.radius) + " px where " + std::to_string(expected) +
                     " px would fit the others";
      return std::nullopt;
    }
  }
  RulerFit fit;
  const auto beyond = [](double value, double variance) { return value * value > 9.0 * variance; };
  if (n >= 2) {
    const Joint both = solve(circles, sorted, middle, true, true);
    fit.distortion_identified = beyond(both.distortion, both.covariance(1, 1));
    fit.aspect_identified = beyond(both.aspect - 1.0, both.covariance(2, 2));
    // One that does not stand alone may do so without the other.
    if (!fit.distortion_identified || !fit.aspect_identified) {
      const Joint bent = solve(circles, sorted, middle, true, false),
                  uneven = solve(circles, sorted, middle, false, true);
      if (!fit.aspect_identified) fit.distortion_identified = beyond(bent.distortion, bent.covariance(1, 1));
      if (!fit.distortion_identified)
        fit.aspect_identified = beyond(uneven.aspect - 1.0, uneven.covariance(2, 2));
    }
    const Joint alone = best;
    best = solve(circles, sorted, middle, fit.distortion_identified, fit.aspect_identified);
    if (!(best.chi < 0.98 * alone.chi)) {
      best = alone;
      fit.distortion_identified = fit.aspect_identified = false;
    }
    fit.camera.distortion_sigma = std::sqrt(both.covariance(1, 1));
    fit.camera.aspect_sigma = std::sqrt(both.covariance(2, 2));
  }
  CameraModel& camera = fit.camera;
  camera.scale = 1.0 / best.per_metre;
  camera.scale_sigma = std::sqrt(best.covariance(0, 0)) / (best.per_metre * best.per_metre);
  camera.distortion = best.distortion;
  camera.aspect = best.aspect;
  if (fit.distortion_identified) camera.distortion_sigma = std::sqrt(best.covariance(1, 1));
  if (fit.aspect_identified) camera.aspect_sigma = std::sqrt(best.covariance(2, 2));
  camera.center = middle;
  double weights = 0.0;
  fit.circles.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    RulerCircle& out = fit.circles[order[i]];
    const Circle& c = circles[i];
    weights += c.weights.sum();
    out.outline = c.shape;
    out.radius = sorted[i];
    out.sigma = 2.0 * c.residual / std::sqrt(std::max(1.0, c.weights.sum()));
    out.residual = c.shape.equal_area_radius() - sorted[i] / camera.local_scale({c.shape.x, c.shape.y});
  }
  fit.residual = std::sqrt(best.chi / std::max(1.0, weights));
  return fit;
}

}  // namespace invar::vision
