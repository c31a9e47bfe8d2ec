#include "components/vision/outline.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "components/vision/ray_samples.hpp"

namespace invar::vision {

namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

struct Direction {
  double c, s, c2, s2;
};

// Directions for each number of rays that is used: multiples of 16.
const std::array<Direction, Rays::most>& directions(int count) {
  static const auto tables = [] {
    std::array<std::array<Direction, Rays::most>, Rays::most / 16 + 1> all{};
    for (int sixteens = 1; sixteens <= Rays::most / 16; ++sixteens)
      for (int i = 0; i < 16 * sixteens; ++i) {
        // Half a step off the axes, so that no ray runs along a row of pixels.
        const double angle = 2.0 * std::numbers::pi * (i + 0.5) / (16.0 * sixteens);
        all[static_cast<std::size_t>(sixteens)][static_cast<std::size_t>(i)] = {
            std::cos(angle), std::sin(angle), std::cos(2.0 * angle), std::sin(2.0 * angle)};
      }
    return all;
  }();
  return tables[static_cast<std::size_t>(count / 16)];
}

double radius_at(const Shape& shape, const Direction& d) {
  return shape.radius + shape.cos2 * d.c2 + shape.sin2 * d.s2;
}

// Of the first `count` values, which are reordered; of every other one where there are many.
double median_of(std::array<double, Rays::most>& values, int count) {
  if (count == 0) return 0.0;
  if (count >= 40) {
    count /= 2;
    for (int i = 0; i < count; ++i)
      values[static_cast<std::size_t>(i)] = values[static_cast<std::size_t>(2 * i)];
  }
  const auto middle = values.begin() + count / 2;
  std::nth_element(values.begin(), middle, values.begin() + count);
  return *middle;
}

struct Harmonics {
  Matrix5 normal;
  Vector5 right;
};

// Weighted normal equations of a + b cos + c sin + d cos2 + e sin2 for the residuals `r`; without the last two where an
// arc is too short to tell an ellipse from a shift.
Harmonics assemble(const std::array<Direction, Rays::most>& table, const std::array<double, Rays::most>& r,
                   const std::array<double, Rays::most>& weight, int count, bool ellipse) {
  std::array<double, 15> n{};
  std::array<double, 5> b{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
    const double w = weight[k];
    if (w == 0.0) continue;
    const Direction& d = table[k];
    const double wc = w * d.c, ws = w * d.s, wc2 = w * d.c2, ws2 = w * d.s2;
    n[0] += w, n[1] += wc, n[2] += ws, n[3] += wc2, n[4] += ws2;
    n[5] += wc * d.c, n[6] += wc * d.s, n[7] += wc * d.c2, n[8] += wc * d.s2;
    n[9] += ws * d.s, n[10] += ws * d.c2, n[11] += ws * d.s2;
    n[12] += wc2 * d.c2, n[13] += wc2 * d.s2, n[14] += ws2 * d.s2;
    b[0] += w * r[k], b[1] += wc * r[k], b[2] += ws * r[k], b[3] += wc2 * r[k], b[4] += ws2 * r[k];
  }
  Harmonics out;
  std::size_t next = 0;
  for (int i = 0; i < 5; ++i) {
    for (int k = i; k < 5; ++k) out.normal(i, k) = out.normal(k, i) = n[next++];
    out.right(i) = b[static_cast<std::size_t>(i)];
  }
  if (!ellipse) {
    out.normal.bottomRows<2>().setZero();
    out.normal.rightCols<2>().setZero();
    out.normal(3, 3) = out.normal(4, 4) = 1.0;
    out.right.tail<2>().setZero();
  }
  return out;
}

// The offsets of the usable rays as a smooth curve: least squares where they all agree, else with Tukey's weights.
// Updates the shape, weights, residual, support and coverage. `floor` is the smallest scale [px] that a residual is
// judged by.
bool fit_shape(Rays& rays, const std::array<bool, Rays::most>& usable, double floor, OutlineFit& fit) {
  const auto& table = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  int open = 0, used = 0;
  for (std::size_t k = 0; k < count; ++k) {
    open += rays.open[k];
    used += usable[k];
    rays.weight[k] = usable[k] ? 1.0 : 0.0;
  }
  if (used < 8) return false;
  const bool ellipse = used >= 0.6 * rays.count;
  std::array<double, Rays::most> sizes, rest{};
  const auto residuals = [&](const Vector5& p) {
    int n = 0;
    for (std::size_t k = 0; k < count; ++k) {
      if (!usable[k]) continue;
      const Direction& d = table[k];
      rest[k] = rays.offset[k] - (p(0) + p(1) * d.c + p(2) * d.s + p(3) * d.c2 + p(4) * d.s2);
      sizes[static_cast<std::size_t>(n++)] = std::abs(rest[k]);
    }
    return n;
  };
  residuals(Vector5::Zero());
  Harmonics h = assemble(table, rest, rays.weight, rays.count, ellipse);
  Vector5 p = h.normal.ldlt().solve(h.right);
  int n = residuals(p);
  const double largest = *std::max_element(sizes.begin(), sizes.begin() + n);
  double scale = std::max(floor, 1.4826 * median_of(sizes, n));
  if (!p.allFinite() || largest > 3.7 * scale) {
    p.setZero();  // the median is a safe start
    n = 0;
    for (std::size_t k = 0; k < count; ++k)
      if (usable[k]) sizes[static_cast<std::size_t>(n++)] = rays.offset[k];
    p(0) = median_of(sizes, n);
    for (int round = 0; round < 14; ++round) {
      n = residuals(p);
      const double previous = scale;
      scale = std::max(floor, 1.4826 * median_of(sizes, n));
      for (std::size_t k = 0; k < count; ++k) {
        if (!usable[k]) continue;
        // Cauchy's weight while far off keeps every ray's say; Tukey's drops what does not belong.
        const double u = rest[k] / (scale * (round < 4 ? 2.4 : 4.7));
        rays.weight[k] =
            round < 4 ? 1.0 / (1.0 + u * u) : (std::abs(u) < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0);
      }
      h = assemble(table, rest, rays.weight, rays.count, ellipse);
      const Vector5 step = h.normal.ldlt().solve(h.right);
      if (!step.allFinite()) return false;
      p += step;
      if (round >= 5 && step.norm() < 1e-3 && std::abs(scale - previous) < 0.03 * scale) break;
    }
    residuals(p);
  }
  double sum = 0.0, square = 0.0;
  int agree = 0;
  for (std::size_t k = 0; k < count; ++k) {
    sum += rays.weight[k];
    square += rays.weight[k] * rest[k] * rest[k];
    agree += rays.weight[k] > 0.2;
  }
  if (!(sum > 5.0)) return false;
  fit.residual = std::sqrt(square / (sum - 5.0 + 1e-9));
  fit.support = agree / static_cast<double>(std::max(1, open));
  fit.coverage = agree / static_cast<double>(rays.count);
  fit.moved = std::abs(p(0)) + std::hypot(p(1), p(2)) + std::hypot(p(3), p(4));
  const Vector5 x_direction = h.normal.ldlt().solve(Vector5::Unit(1)),
                y_direction = h.normal.ldlt().solve(Vector5::Unit(2));
  fit.sigma = fit.residual * std::sqrt(std::max(x_direction(1), y_direction(2)));
  fit.shape.x += p(1);
  fit.shape.y += p(2);
  fit.shape.radius += p(0);
  fit.shape.cos2 += p(3);
  fit.shape.sin2 += p(4);
  return fit.shape.radius > 0.5;
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
  count = 16 * std::clamp(static_cast<int>(std::lround(radius * std::numbers::pi / 20.0)), 2, most / 16);
  open.fill(true);
  weight.fill(1.0);
}

double ray_angle(const Rays& rays, int i) { return 2.0 * std::numbers::pi * (i + 0.5) / rays.count; }

void Rays::close(const Shape& shape, double reach, double x, double y, double radius, double guard) {
  const double dx = x - shape.x, dy = y - shape.y, limit = radius + guard;
  const double near = shape.radius + reach + limit;
  if (dx * dx + dy * dy > near * near) return;
  const auto& table = directions(count);
  for (int i = 0; i < count; ++i) {
    const Direction& d = table[static_cast<std::size_t>(i)];
    const double r = radius_at(shape, d);
    // The nearest point of the ray's piece to the disc's centre.
    const double along = std::clamp(dx * d.c + dy * d.s, r - 0.5 * reach, r + reach);
    if (std::hypot(dx - along * d.c, dy - along * d.s) < limit) open[static_cast<std::size_t>(i)] = false;
  }
}

OutlineFit seek_outline(const cv::Mat& image, const Shape& shape, int polarity, double reach, Rays& rays) {
  const RaySamples samples{image};
  const auto& table = directions(rays.count);
  const int half = std::clamp(static_cast<int>(std::ceil(reach)), 3, 30);
  alignas(64) std::array<float, 72> f{};  // 65, and what a read fills up
  std::array<double, Rays::most> heights{}, sorted{};
  std::array<bool, Rays::most> usable{};
  int n = 0;
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!rays.open[k]) continue;
    const Direction& d = table[k];
    const double r0 = radius_at(shape, d);
    const int inward = std::min(half, static_cast<int>(r0));
    const double begin = r0 - inward - 2, end = r0 + half + 2;
    if (!samples.holds(shape.x + begin * d.c, shape.y + begin * d.s) ||
        !samples.holds(shape.x + end * d.c, shape.y + end * d.s)) {
      rays.open[k] = false;
      continue;
    }
    const int length = inward + half + 5;
    samples.read(shape.x + begin * d.c, shape.y + begin * d.s, d.c, d.s, static_cast<std::size_t>(length),
                 f.data());
    // Differences of two samples each side; an edge nearer to where it is expected wins over an equal one farther off.
    double best = 0.0, height = 0.0;
    int at = -1;
    const auto difference = [&](int j) {
      const auto m = static_cast<std::size_t>(j);
      return 0.5 * polarity * static_cast<double>(f[m - 2] + f[m - 1] - f[m + 1] - f[m + 2]);
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
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (usable[k] && heights[k] < 0.35 * fit.contrast) usable[k] = false;
  }
  fit.valid = fit_shape(rays, usable, 0.35, fit);
  return fit;
}

OutlineFit refine_outline(const cv::Mat& image, const Shape& shape, int polarity, const EdgeFilter& filter,
                          Rays& rays) {
  const RaySamples samples{image};
  const auto& table = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  const int half = filter.half;
  const auto length = static_cast<std::size_t>(2 * half + 1);
  std::array<bool, Rays::most> usable{};
  std::array<RayProducts, Rays::most> products;  // written before they are read
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  alignas(64) std::array<std::array<float, EdgeFilter::padded>, 3>
      sums{};  // level, cosine, sine: over the rays
  alignas(64) std::array<float, EdgeFilter::padded> f{};
  for (std::size_t k = 0; k < count; ++k) {
    if (!rays.open[k]) continue;
    const Direction& d = table[k];
    const double begin = radius_at(shape, d) - half, end = begin + 2 * half;
    if (!samples.holds(shape.x + begin * d.c, shape.y + begin * d.s) ||
        !samples.holds(shape.x + end * d.c, shape.y + end * d.s)) {
      rays.open[k] = false;
      continue;
    }
    samples.read(shape.x + begin * d.c, shape.y + begin * d.s, d.c, d.s, length, f.data());
    usable[k] = true;
    const double w = rays.weight[k];
    const std::array<float, 3> harmonic{static_cast<float>(w), static_cast<float>(w * d.c),
                                        static_cast<float>(w * d.s)};
    products[k] = take_products(f, filter, length, harmonic, sums);
    normal(0, 0) += w, normal(0, 1) += w * d.c, normal(0, 2) += w * d.s;
    normal(1, 1) += w * d.c * d.c, normal(1, 2) += w * d.c * d.s, normal(2, 2) += w * d.s * d.s;
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
    const Eigen::Vector3d harmonic =
        inverse * Eigen::Vector3d{static_cast<double>(sums[0][j]), static_cast<double>(sums[1][j]),
                                  static_cast<double>(sums[2][j])};
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
  std::array<double, Rays::most> misfit, sorted;  // written before they are read
  for (std::size_t k = 0; k < count; ++k) {
    if (!usable[k]) continue;
    const Direction& d = table[k];
    const double in = inside(0) + inside(1) * d.c + inside(2) * d.s;
    const double out = outside(0) + outside(1) * d.c + outside(2) * d.s;
    const RayProducts& p = products[k];
    // Least squares is linear: what the slopes give is taken off the result instead of off every sample.
    const Eigen::Vector3d levels =
        Eigen::Vector3d{p.rows[EdgeFilter::to_ground], p.rows[EdgeFilter::to_height],
                        p.rows[EdgeFilter::to_shift]} -
        in * filter.from_inner - out * filter.from_outer;
    const double height = levels(1), shift = levels(2), contrast = polarity * height;
    if (contrast < 0.4 * fit.contrast || contrast > 2.5 * fit.contrast) {
      usable[k] = false;
      continue;
    }
    const double square = p.square -
                          2.0 * (in * p.rows[EdgeFilter::to_inner] + out * p.rows[EdgeFilter::to_outer]) +
                          in * in * filter.inner_inner + 2.0 * in * out * filter.inner_outer +
                          out * out * filter.outer_outer - levels.dot(filter.columns * levels);
    const double limit = 2.0 * filter.blur + 0.5;  // the linear step reaches no farther
    rays.offset[k] = std::clamp(shift / height, -limit, limit);
    misfit[k] = std::sqrt(std::max(0.0, square));
    sorted[static_cast<std::size_t>(n++)] = misfit[k];
  }
  // A scratch or a speck across the ray spoils its profile before it moves its edge.
  const double usual = median_of(sorted, n);
  for (std::size_t k = 0; k < count; ++k)
    if (usable[k] && misfit[k] > 2.5 * usual + 0.03 * fit.contrast) usable[k] = false;
  fit.valid = fit_shape(rays, usable, 0.015, fit);
  return fit;
}

}  // namespace invar::vision
