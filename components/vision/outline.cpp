#include "components/vision/outline.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

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

struct Samples {
  const std::uint8_t* data;
  std::ptrdiff_t stride;
  float right, bottom;  // the last coordinates that bilinear reading allows
  explicit Samples(const cv::Mat& image)
      : data{image.ptr<std::uint8_t>()},
        stride{static_cast<std::ptrdiff_t>(image.step)},
        right{static_cast<float>(image.cols) - 1.001F},
        bottom{static_cast<float>(image.rows) - 1.001F} {}
  [[nodiscard]] bool holds(double x, double y) const {
    return x >= 0.0 && y >= 0.0 && x <= static_cast<double>(right) && y <= static_cast<double>(bottom);
  }
  [[nodiscard]] float at(float x, float y) const {
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const float u = x - static_cast<float>(i), v = y - static_cast<float>(j);
    const std::uint8_t* p = data + j * stride + i;
    const auto a = static_cast<float>(p[0]), b = static_cast<float>(p[1]);
    const auto c = static_cast<float>(p[stride]), d = static_cast<float>(p[stride + 1]);
    const float upper = a + u * (b - a), lower = c + u * (d - c);
    return upper + v * (lower - upper);
  }
};

double radius_at(const Shape& shape, const Direction& d) {
  return shape.radius + shape.cos2 * d.c2 + shape.sin2 * d.s2;
}

double median_of(std::array<double, Rays::most>& values, int count) {
  if (count == 0) return 0.0;
  const auto middle = values.begin() + count / 2;
  std::nth_element(values.begin(), middle, values.begin() + count);
  return *middle;
}

// Offsets as a + b cos + c sin + d cos2 + e sin2 with Tukey's weights; `usable` rays only. Updates the shape, weights,
// residual, support and coverage. `floor` is the smallest scale [px] that a residual is judged by.
bool fit_shape(Rays& rays, const std::array<bool, Rays::most>& usable, double floor, OutlineFit& fit) {
  const auto& table = directions(rays.count);
  int open = 0, used = 0;
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    open += rays.open[k];
    used += usable[k];
    rays.weight[k] = usable[k] ? 1.0 : 0.0;
  }
  if (used < 8) return false;
  const bool whole = used >= 0.6 * rays.count;  // on a shorter arc an ellipse is not told from a shift
  std::array<double, Rays::most> sizes{};
  Vector5 p = Vector5::Zero();
  {  // the median is a safe start
    int n = 0;
    for (int i = 0; i < rays.count; ++i)
      if (usable[static_cast<std::size_t>(i)])
        sizes[static_cast<std::size_t>(n++)] = rays.offset[static_cast<std::size_t>(i)];
    p(0) = median_of(sizes, n);
  }
  double scale = 0.0;
  Matrix5 normal;
  for (int round = 0; round < 12; ++round) {
    int n = 0;
    for (int i = 0; i < rays.count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!usable[k]) continue;
      const Direction& d = table[k];
      const double r = rays.offset[k] - (p(0) + p(1) * d.c + p(2) * d.s + p(3) * d.c2 + p(4) * d.s2);
      sizes[static_cast<std::size_t>(n++)] = std::abs(r);
      rays.weight[k] = r;  // until the scale is known
    }
    const double previous = scale;
    scale = std::max(floor, 1.4826 * median_of(sizes, n));
    normal.setZero();
    Vector5 right = Vector5::Zero();
    for (int i = 0; i < rays.count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!usable[k]) continue;
      // Cauchy's weight while far off keeps every ray's say; Tukey's drops what does not belong.
      const double r = rays.weight[k], u = r / (scale * (round < 4 ? 2.4 : 4.7));
      const double w =
          round < 4 ? 1.0 / (1.0 + u * u) : (std::abs(u) < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0);
      rays.weight[k] = w;
      const Direction& d = table[k];
      Vector5 row;
      row << 1.0, d.c, d.s, d.c2, d.s2;
      if (!whole) row.tail<2>().setZero();
      normal += w * row * row.transpose();
      right += w * r * row;
    }
    if (!whole) normal.diagonal().tail<2>().setOnes();
    const Vector5 step = normal.ldlt().solve(right);
    if (!step.allFinite()) return false;
    p += step;
    if (round >= 5 && step.norm() < 2e-4 && std::abs(scale - previous) < 0.02 * scale) break;
  }
  double sum = 0.0, square = 0.0;
  int agree = 0;
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!usable[k]) continue;
    const Direction& d = table[k];
    const double r = rays.offset[k] - (p(0) + p(1) * d.c + p(2) * d.s + p(3) * d.c2 + p(4) * d.s2);
    sum += rays.weight[k];
    square += rays.weight[k] * r * r;
    agree += rays.weight[k] > 0.2;
  }
  if (!(sum > 5.0)) return false;
  fit.residual = std::sqrt(square / (sum - 5.0 + 1e-9));
  fit.support = agree / static_cast<double>(std::max(1, open));
  fit.coverage = agree / static_cast<double>(rays.count);
  fit.moved = std::abs(p(0)) + std::hypot(p(1), p(2)) + std::hypot(p(3), p(4));
  const Matrix5 inverse = normal.ldlt().solve(Matrix5::Identity());
  fit.sigma = fit.residual * std::sqrt(std::max(inverse(1, 1), inverse(2, 2)));
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
  count = 16 * std::clamp(static_cast<int>(std::lround(radius * std::numbers::pi / 16.0)), 2, most / 16);
  open.fill(true);
  weight.fill(1.0);
}

double ray_angle(const Rays& rays, int i) { return 2.0 * std::numbers::pi * (i + 0.5) / rays.count; }

void Rays::close(const Shape& shape, double reach, double x, double y, double radius, double guard) {
  const double dx = x - shape.x, dy = y - shape.y, limit = radius + guard;
  if (std::hypot(dx, dy) > shape.radius + reach + limit) return;
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
  const Samples samples{image};
  const auto& table = directions(rays.count);
  const int half = std::clamp(static_cast<int>(std::ceil(reach)), 3, 30);
  std::array<float, 65> f{};
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
    auto x = static_cast<float>(shape.x + begin * d.c), y = static_cast<float>(shape.y + begin * d.s);
    const auto step_x = static_cast<float>(d.c), step_y = static_cast<float>(d.s);
    for (int j = 0; j < length; ++j, x += step_x, y += step_y)
      f[static_cast<std::size_t>(j)] = samples.at(x, y);
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
  const Samples samples{image};
  const auto& table = directions(rays.count);
  const int half = filter.half, length = 2 * half + 1;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, EdgeFilter::most, Rays::most>;
  Matrix profiles(length, rays.count);  // a column a ray
  std::array<bool, Rays::most> usable{};
  std::array<double, Rays::most> sorted{};
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!rays.open[k]) continue;
    const Direction& d = table[k];
    const double begin = radius_at(shape, d) - half, end = begin + 2 * half;
    if (!samples.holds(shape.x + begin * d.c, shape.y + begin * d.s) ||
        !samples.holds(shape.x + end * d.c, shape.y + end * d.s)) {
      rays.open[k] = false;
      continue;
    }
    auto x = static_cast<float>(shape.x + begin * d.c), y = static_cast<float>(shape.y + begin * d.s);
    const auto step_x = static_cast<float>(d.c), step_y = static_cast<float>(d.s);
    for (int j = 0; j < length; ++j, x += step_x, y += step_y)
      profiles(j, i) = static_cast<double>(samples.at(x, y));
    usable[k] = true;
  }

  // Slopes: the profile at each k over the angle as constant and first harmonic, then the sloped step on each of these.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, EdgeFilter::most> moments(3, length);
  moments.setZero();
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double w = usable[k] ? rays.weight[k] : 0.0;
    if (!(w > 0.0)) continue;
    const Eigen::Vector3d row{1.0, table[k].c, table[k].s};
    normal += w * row * row.transpose();
    moments += (w * row) * profiles.col(i).transpose();
  }
  OutlineFit fit;
  fit.shape = shape;
  if (!(normal(0, 0) > 5.0)) return fit;
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, EdgeFilter::most> harmonics =
      normal.ldlt().solve(moments);
  const Eigen::Matrix<double, 5, 3> sloped = filter.sloped * harmonics.transpose();
  const Eigen::Vector3d inside = sloped.row(3).transpose(), outside = sloped.row(4).transpose();

  EdgeFilter::Profile level = harmonics.row(0).transpose();
  level -= inside(0) * filter.inner + outside(0) * filter.outer;
  const Eigen::Vector4d common = filter.spread * level;
  fit.contrast = polarity * common(1);
  fit.blur = std::clamp(filter.blur + (common(1) != 0.0 ? common(3) / common(1) : 0.0), 0.5 * filter.blur,
                        2.0 * filter.blur);
  if (!(fit.contrast > 0.0)) return fit;

  int n = 0;
  std::array<double, Rays::most> misfit{};
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!usable[k]) continue;
    const Eigen::Vector3d row{1.0, table[k].c, table[k].s};
    const EdgeFilter::Profile y =
        profiles.col(i) - row.dot(inside) * filter.inner - row.dot(outside) * filter.outer;
    const Eigen::Vector3d p = filter.step * y;
    const double contrast = polarity * p(1);
    if (contrast < 0.4 * fit.contrast || contrast > 2.5 * fit.contrast) {
      usable[k] = false;
      continue;
    }
    const double limit = 2.0 * filter.blur + 0.5;  // the linear step reaches no farther
    rays.offset[k] = std::clamp(p(2) / p(1), -limit, limit);
    misfit[k] = (y - (p(0) + p(1) * filter.unit.array() + p(2) * filter.bump.array()).matrix()).norm();
    sorted[static_cast<std::size_t>(n++)] = misfit[k];
  }
  // A scratch or a speck across the ray spoils its profile before it moves its edge.
  const double usual = median_of(sorted, n);
  for (int i = 0; i < rays.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (usable[k] && misfit[k] > 2.5 * usual + 0.01 * fit.contrast) usable[k] = false;
  }
  fit.valid = fit_shape(rays, usable, 0.01, fit);
  return fit;
}

}  // namespace invar::vision
