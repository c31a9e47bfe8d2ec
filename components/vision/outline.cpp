#include "components/vision/outline.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "components/vision/outline_curve.hpp"
#include "components/vision/ray_samples.hpp"

namespace invar::vision {

namespace {

// The samples of the open rays of a block of eight; those that leave the image are closed. True where any is open.
struct Block {
  std::array<double, lanes> open{};  // 1 or 0
  EightRays rays;
};
bool prepare(const RaySamples& samples, const Shape& shape, const Directions& d, std::size_t first,
             double inward, double outward, Rays& rays, Block& block) {
  bool any = false;
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t k = first + lane;
    if (!rays.open[k]) continue;
    const double r = radius_at(shape, d, k), begin = r - inward, end = r + outward;
    const double x = shape.x + begin * d.c[k], y = shape.y + begin * d.s[k];
    rays.open[k] = samples.holds(x, y) && samples.holds(shape.x + end * d.c[k], shape.y + end * d.s[k]);
    if (!rays.open[k]) continue;
    block.rays.set(lane, x, y, d.c[k], d.s[k]);
    block.open[lane] = 1.0;
    any = true;
  }
  return any;
}

}  // namespace

double Shape::equal_area_radius() const {
  return std::sqrt(radius * radius + 0.5 * (cos2 * cos2 + sin2 * sin2));
}

double Shape::axis_ratio() const {
  const double amplitude = std::hypot(cos2, sin2);
  return (radius - amplitude) / (radius + amplitude);
}

void Rays::choose(double radius) {
  count = 16 * std::clamp(static_cast<int>(std::lround(radius * std::numbers::pi / 20.0)), 1, most / 16);
  open.fill(true);
  weight.fill(1.0);
}

double ray_angle(const Rays& rays, int i) { return 2.0 * std::numbers::pi * (i + 0.5) / rays.count; }

void Rays::close(const Shape& shape, double reach, double x, double y, double radius, double guard) {
  const double dx = x - shape.x, dy = y - shape.y, limit = radius + guard;
  const double near = shape.radius + reach + limit;
  if (dx * dx + dy * dy > near * near) return;
  const Directions& d = directions(count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const double r = radius_at(shape, d, i);
    // The nearest point of the ray's piece to the disc's centre.
    const double along = std::clamp(dx * d.c[i] + dy * d.s[i], r - 0.5 * reach, r + reach);
    const double away_x = dx - along * d.c[i], away_y = dy - along * d.s[i];
    if (away_x * away_x + away_y * away_y < limit * limit) open[i] = false;
  }
}

OutlineFit seek_outline(const cv::Mat& image, const Shape& shape, int polarity, double reach, Rays& rays) {
  const RaySamples samples{image};
  const Directions& d = directions(rays.count);
  const int half = std::clamp(static_cast<int>(std::ceil(reach)), 3, 30);
  const int inward = std::min(half, static_cast<int>(shape.radius - std::hypot(shape.cos2, shape.sin2)));
  const int length = inward + half + 5;
  std::array<Lanes, 65> f;
  Values heights{}, sorted{};
  std::array<bool, Rays::most> usable{};
  int n = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(rays.count); ++k) {
    const std::size_t lane = k % lanes;
    if (lane == 0) {
      Block block;
      if (prepare(samples, shape, d, k, inward + 2, half + 2, rays, block))
        samples.read(block.rays, static_cast<std::size_t>(length), f.data());
    }
    if (!rays.open[k]) continue;
    // Differences of two samples each side; an edge nearer to where it is expected wins over an equal one farther off.
    double best = 0.0, height = 0.0;
    int at = -1;
    const auto difference = [&](int j) {
      const auto m = static_cast<std::size_t>(j);
      return 0.5 * polarity *
             static_cast<double>(f[m - 2][lane] + f[m - 1][lane] - f[m + 1][lane] - f[m + 2][lane]);
    };
    for (int j = 2; j < length - 2; ++j) {
      const double away = (j - 2 - inward) / (reach + 1.0), value = difference(j) * (1.0 - 0.3 * away * away);
      if (value > best) best = value, at = j;
    }
    if (at < 0) continue;
    height = difference(at);
    double fraction = 0.0;
    if (at > 2 && at < length - 3) {
      const double before = difference(at - 1), after = difference(at + 1),
                   bend = before - 2.0 * height + after;
      if (bend < 0.0) fraction = std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
    }
    rays.offset[k] = at - 2 - inward + fraction;
    heights[k] = sorted[static_cast<std::size_t>(n++)] = height;
    usable[k] = true;
  }
  OutlineFit fit;
  fit.shape = shape;
  if (n < 8) return fit;
  fit.contrast = median_of(sorted, n);
  for (std::size_t k = 0; k < static_cast<std::size_t>(rays.count); ++k)
    if (usable[k] && heights[k] < 0.35 * fit.contrast) usable[k] = false;
  fit.valid = fit_shape(rays, usable, 0.35, fit);
  return fit;
}

OutlineFit refine_outline(const cv::Mat& image, const Shape& shape, int polarity, const EdgeFilter& filter,
                          Rays& rays) {
  const RaySamples samples{image};
  const Directions& d = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  const auto length = static_cast<std::size_t>(2 * filter.half + 1);
  std::array<bool, Rays::most> usable{};
  std::array<RayProducts, Rays::most / lanes> products;  // written before they are read
  std::array<Lanes, EdgeFilter::most> f;
  HarmonicSums by_lane;  // level, cosine, sine: over the rays
  for (auto& sums : by_lane) std::fill_n(sums.begin(), length, Lanes{});
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (std::size_t first = 0; first < count; first += lanes) {
    Block block;
    if (!prepare(samples, shape, d, first, filter.half, filter.half, rays, block)) continue;
    std::array<Lanes, 3> harmonic;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::size_t k = first + lane;
      usable[k] = block.open[lane] > 0.0;
      const double w = block.open[lane] * rays.weight[k], c = d.c[k], s = d.s[k];
      harmonic[0][lane] = static_cast<float>(w);
      harmonic[1][lane] = static_cast<float>(w * c);
      harmonic[2][lane] = static_cast<float>(w * s);
      normal(0, 0) += w, normal(0, 1) += w * c, normal(0, 2) += w * s;
      normal(1, 1) += w * c * c, normal(1, 2) += w * c * s, normal(2, 2) += w * s * s;
    }
    samples.read(block.rays, length, f.data());
    take_products(f.data(), filter, harmonic, products[first / lanes], by_lane);
  }
  OutlineFit fit;
  fit.shape = shape;
  if (!(normal(0, 0) > 5.0)) return fit;
  normal(1, 0) = normal(0, 1), normal(2, 0) = normal(0, 2), normal(2, 1) = normal(1, 2);

  // Slopes: the profile at each sample over the angle as constant and first harmonic, then the sloped step on each.
  const Eigen::Matrix3d inverse = normal.inverse();
  std::array<Eigen::Matrix<double, 5, 1>, 3> sloped{Eigen::Matrix<double, 5, 1>::Zero(),
                                                    Eigen::Matrix<double, 5, 1>::Zero(),
                                                    Eigen::Matrix<double, 5, 1>::Zero()};
  EdgeFilter::Profile mean(static_cast<Eigen::Index>(length));
  for (std::size_t j = 0; j < length; ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    Eigen::Vector3d sums;
    for (std::size_t m = 0; m < 3; ++m) {
      const Lanes& part = by_lane[m][j];
      sums(static_cast<Eigen::Index>(m)) = static_cast<double>(((part[0] + part[4]) + (part[1] + part[5])) +
                                                               ((part[2] + part[6]) + (part[3] + part[7])));
    }
    const Eigen::Vector3d harmonic = inverse * sums;
    for (std::size_t m = 0; m < 3; ++m)
      sloped[m] += harmonic(static_cast<Eigen::Index>(m)) * filter.sloped.col(column);
    mean(column) = harmonic(0);
  }
  const Eigen::Vector3d inside{sloped[0](3), sloped[1](3), sloped[2](3)},
      outside{sloped[0](4), sloped[1](4), sloped[2](4)};
  mean -= inside(0) * filter.inner + outside(0) * filter.outer;
  const Eigen::Vector4d common = filter.spread * mean;
  fit.contrast = polarity * common(1);
  if (!(fit.contrast > 0.0)) return fit;
  fit.blur = std::clamp(filter.blur + common(3) / common(1), 0.5 * filter.blur, 2.0 * filter.blur);

  int n = 0;
  Values misfit, sorted;                         // written before they are read
  const double reach = 2.0 * filter.blur + 0.5;  // the linear step reaches no farther
  for (std::size_t k = 0; k < count; ++k) {
    if (!usable[k]) continue;
    const double in = inside(0) + inside(1) * d.c[k] + inside(2) * d.s[k];
    const double out = outside(0) + outside(1) * d.c[k] + outside(2) * d.s[k];
    const RayProducts& p = products[k / lanes];
    const auto row = [&](EdgeFilter::Row which) { return static_cast<double>(p.rows[which][k % lanes]); };
    // Least squares is linear: what the slopes give is taken off the result instead of off every sample.
    const Eigen::Vector3d levels =
        Eigen::Vector3d{row(EdgeFilter::to_ground), row(EdgeFilter::to_height), row(EdgeFilter::to_shift)} -
        in * filter.from_inner - out * filter.from_outer;
    const double height = levels(1), shift = levels(2), contrast = polarity * height;
    if (contrast < 0.4 * fit.contrast || contrast > 2.5 * fit.contrast) {
      usable[k] = false;
      continue;
    }
    const double square = static_cast<double>(p.square[k % lanes]) -
                          2.0 * (in * row(EdgeFilter::to_inner) + out * row(EdgeFilter::to_outer)) +
                          in * in * filter.inner_inner + 2.0 * in * out * filter.inner_outer +
                          out * out * filter.outer_outer - levels.dot(filter.columns * levels);
    rays.offset[k] = std::clamp(shift / height, -reach, reach);
    misfit[k] = std::sqrt(std::max(0.0, square));
    sorted[static_cast<std::size_t>(n++)] = misfit[k];
  }
  // A scratch or a speck across the ray spoils its profile before it moves its edge.
  const double most = n > 0 ? *std::max_element(sorted.begin(), sorted.begin() + n) : 0.0;
  if (!half_reach(sorted, n, (most - 0.03 * fit.contrast) / 2.5)) {
    const double limit = 2.5 * median_of(sorted, n) + 0.03 * fit.contrast;
    for (std::size_t k = 0; k < count; ++k)
      if (usable[k] && misfit[k] > limit) usable[k] = false;
  }
  fit.valid = fit_shape(rays, usable, 0.015, fit);
  return fit;
}

}  // namespace invar::vision
