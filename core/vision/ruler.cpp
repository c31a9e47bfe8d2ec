#include "core/vision/ruler.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/numerics/decompositions.hpp"
#include "core/vision/blobs.hpp"

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
    circle.edges.col(i) =
        Vector2d{sought.x, sought.y} + (radius + static_cast<double>(rays.offset[k]) + push) * direction;
    circle.weights(i) = rays.open[k] ? static_cast<double>(rays.weight[k]) : 0.0;
  }
  return circle;
}

std::vector<Circle> find_circles(const cv::Mat& image) {
  // A ruler's circles are few, large and of different sizes: a wide window, and reduced so far that dust is gone.
  DetectionOptions options;
  options.window = 6;
  options.level = 0;
  while (std::min(image.cols, image.rows) >> (options.level + 1) >= 150) ++options.level;
  const Detection found = detect(image, options);
  std::vector<Circle> circles;
  for (const Candidate& candidate : found.candidates) {
    Shape shape{candidate.x, candidate.y, candidate.radius, 0.0, 0.0};
    Rays rays;
    rays.choose(2.0 * shape.radius);  // there is time, and few circles
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

// What may be free beside the scale and the centres.
enum Effect : std::size_t { distortion, aspect, offset, effects };
using Free = std::array<bool, effects>;

// Gauss-Newton over 1/scale [px/m], the effects and the centres (ideal px).
struct Joint {
  double per_metre = 0.0;                            // px/m
  std::array<double, effects> value{0.0, 1.0, 0.0};  // 1/px^2, 1, px
  std::array<double, effects> sigma{};               // 0 where held
  double per_metre_sigma = 0.0;
  std::vector<Vector2d> centers;
  double chi = 0.0;  // sum of weighted squares, px^2
};

Joint solve(const std::vector<Circle>& circles, const std::vector<double>& radii, const Vector2d& middle,
            const Free& free) {
  constexpr Index common = 1 + effects;
  const Index n = static_cast<Index>(circles.size()), size = common + 2 * n;
  const double unit = 1.0 / (middle.squaredNorm() + 1.0);  // distortion in shares at the corner: well scaled
  Joint at;
  double measured = 0.0, known = 0.0;
  for (std::size_t j = 0; j < circles.size(); ++j) {
    measured += circles[j].shape.radius * radii[j];
    known += radii[j] * radii[j];
    at.centers.emplace_back(circles[j].shape.x, circles[j].shape.y);
  }
  const double size_unit = measured / known;
  double relative = 1.0, share = 0.0, stretch = 1.0, beyond = 0.0;
  Eigen::MatrixXd normal;
  double weight_sum = 0.0;
  for (int round = 0; round < 20; ++round) {
    normal = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    at.chi = weight_sum = 0.0;
    for (Index j = 0; j < n; ++j) {
      const Circle& circle = circles[static_cast<std::size_t>(j)];
      const Vector2d center = at.centers[static_cast<std::size_t>(j)];
      const double known_radius = size_unit * radii[static_cast<std::size_t>(j)];
      for (Index i = 0; i < circle.edges.cols(); ++i) {
        const double w = circle.weights(i);
        if (!(w > 0.0)) continue;
        const Vector2d away = circle.edges.col(i) - middle;
        const double square = away.squaredNorm();
        Vector2d delta = away * (1.0 + unit * share * square) - center + middle;
        delta.y() *= stretch;
        const double distance = delta.norm();
        const Vector2d direction = delta / distance;
        const double residual = distance - known_radius * relative - beyond;
        Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
        row(0) = -known_radius;
        if (free[distortion])
          row(1) = unit * square * (direction.x() * away.x() + direction.y() * stretch * away.y());
        if (free[aspect]) row(2) = direction.y() * delta.y() / stretch;
        if (free[offset]) row(3) = -1.0;
        row(common + 2 * j) = -direction.x();
        row(common + 1 + 2 * j) = -direction.y() * stretch;
        normal += w * row * row.transpose();
        right -= w * residual * row;
        at.chi += w * residual * residual;
        weight_sum += w;
      }
    }
    for (std::size_t e = 0; e < effects; ++e)
      if (!free[e]) normal(static_cast<Index>(1 + e), static_cast<Index>(1 + e)) = 1.0;
    const Eigen::VectorXd step = numerics::solve_symmetric(normal, right);
    relative += step(0), share += step(1), stretch += step(2), beyond += step(3);
    for (Index j = 0; j < n; ++j) at.centers[static_cast<std::size_t>(j)] += step.segment<2>(common + 2 * j);
    if (step.head<3>().norm() + step(3) / size_unit < 1e-12) break;
  }
  at.per_metre = size_unit * relative;
  at.value = {unit * share, stretch, beyond};
  const double freedom = std::max(1.0, weight_sum - static_cast<double>(size));
  const Eigen::MatrixXd inverse = numerics::solve_symmetric(normal, Eigen::MatrixXd::Identity(size, size));
  // Neighbouring rays share pixels, and what remains of an edge's shape is common to a circle: the residuals are not
  // independent. A correlation over four rays is what simulated pictures show.
  const double variance = 4.0 * at.chi / freedom;
  const auto sigma = [&](Index k) { return std::sqrt(variance * inverse(k, k)); };
  at.per_metre_sigma = size_unit * sigma(0);
  at.sigma = {free[distortion] ? unit * sigma(1) : 0.0, free[aspect] ? sigma(2) : 0.0,
              free[offset] ? sigma(3) : 0.0};
  return at;
}

// How many standard deviations an effect is from none.
double strength(const Joint& fit, std::size_t effect) {
  const double none = effect == aspect ? 1.0 : 0.0;
  return std::abs(fit.value[effect] - none) / std::max(1e-300, fit.sigma[effect]);
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

  // All effects first; the weakest goes until each is beyond doubt. An offset needs three sizes to show.
  Free free{true, true, n >= 3 && sorted.front() > 1.5 * sorted.back()};
  if (n < 2) free = {false, false, false};
  const Joint all = solve(circles, sorted, middle, free);
  Joint best = all;
  for (;;) {
    std::size_t weakest = effects;
    for (std::size_t e = 0; e < effects; ++e)
      if (free[e] && (weakest == effects || strength(best, e) < strength(best, weakest))) weakest = e;
    if (weakest == effects || strength(best, weakest) > 3.5) break;
    free[weakest] = false;
    best = solve(circles, sorted, middle, free);
  }
  RulerFit fit;
  fit.distortion_identified = free[distortion];
  fit.aspect_identified = free[aspect];
  fit.offset_identified = free[offset];
  fit.offset = best.value[offset];
  fit.offset_sigma = free[offset] ? best.sigma[offset] : all.sigma[offset];
  CameraModel& camera = fit.camera;
  camera.scale = 1.0 / best.per_metre;
  camera.scale_sigma = best.per_metre_sigma / (best.per_metre * best.per_metre);
  camera.distortion = best.value[distortion];
  camera.distortion_sigma = free[distortion] ? best.sigma[distortion] : all.sigma[distortion];
  camera.aspect = best.value[aspect];
  camera.aspect_sigma = free[aspect] ? best.sigma[aspect] : all.sigma[aspect];
  camera.center = middle;
  camera.width = image.cols;
  camera.height = image.rows;
  for (std::size_t i = 0; i < n; ++i) {
    const Shape& shape = circles[i].shape;
    const double expected = sorted[i] / camera.local_scale({shape.x, shape.y}) + fit.offset;
    if (std::abs(shape.radius - expected) > std::max(0.5, 0.01 * expected) ||
        std::abs(fit.offset) > 0.2 * circles.back().shape.radius) {
      failure.what = "the circles' sizes do not match the ruler: one has a radius of " +
                     std::to_string(shape.radius) + " px where " + std::to_string(expected) +
                     " px would fit the others";
      return std::nullopt;
    }
  }
  double weights = 0.0;
  fit.circles.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    RulerCircle& out = fit.circles[order[i]];
    const Circle& c = circles[i];
    weights += c.weights.sum();
    out.outline = c.shape;
    out.radius = sorted[i];
    out.sigma = 2.0 * c.residual / std::sqrt(std::max(1.0, c.weights.sum()));
    out.residual =
        c.shape.equal_area_radius() - fit.offset - sorted[i] / camera.local_scale({c.shape.x, c.shape.y});
  }
  fit.residual = std::sqrt(best.chi / std::max(1.0, weights));
  return fit;
}

}  // namespace invar::vision
