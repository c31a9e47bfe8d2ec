#include "components/vision/outline_curve.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

namespace invar::vision {

namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

// Weighted least squares of a + b cos + c sin + d cos2 + e sin2; without the last two where an arc is too short to tell an
// ellipse from a shift.
class HarmonicFit {
 public:
  /// False where the rays do not determine the curve.
  [[nodiscard]] bool fit(const Directions& d, const Values& weight, const Values& r, std::size_t count,
                         bool ellipse) {
    using Eight [[gnu::vector_size(64)]] = double;
    using Four [[gnu::vector_size(32)]] = double;
    Eight sums{};  // of the weights by cosine and sine of the angle, its double, triple and fourfold
    Four products{};
    double w0 = 0.0, r0 = 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      const double w = weight[k], wr = w * r[k];
      Eight eight;
      Four four;
      std::memcpy(&eight, d.powers[k].data(), sizeof eight);
      std::memcpy(&four, d.powers[k].data(), sizeof four);
      sums += w * eight;
      products += wr * four;
      w0 += w, r0 += wr;
    }
    const double c1 = sums[0], s1 = sums[1], c2 = sums[2], s2 = sums[3], c3 = sums[4], s3 = sums[5],
                 c4 = sums[6], s4 = sums[7];
    // Products of harmonics are harmonics of sum and difference.
    Matrix5 normal;
    normal.row(0) << w0, 0.0, 0.0, 0.0, 0.0;
    normal.row(1) << c1, 0.5 * (w0 + c2), 0.0, 0.0, 0.0;
    normal.row(2) << s1, 0.5 * s2, 0.5 * (w0 - c2), 0.0, 0.0;
    normal.row(3) << c2, 0.5 * (c1 + c3), 0.5 * (s3 - s1), 0.5 * (w0 + c4), 0.0;
    normal.row(4) << s2, 0.5 * (s1 + s3), 0.5 * (c1 - c3), 0.5 * s4, 0.5 * (w0 - c4);
    size_ = ellipse ? 5 : 3;
    if (!factor(normal)) return false;
    Vector5 right;
    right << r0, products[0], products[1], products[2], products[3];
    solution = solve(right);
    return solution.allFinite();
  }
  /// Of the coordinate of the centre that is known worse, for residuals of variance 1.
  [[nodiscard]] double variance() const {
    return std::max(solve(Vector5::Unit(1))(1), solve(Vector5::Unit(2))(2));
  }
  Vector5 solution = Vector5::Zero();

 private:
  // Cholesky; a pivot that vanishes beside its diagonal is none.
  bool factor(const Matrix5& normal) {
    for (int j = 0; j < size_; ++j) {
      double pivot = normal(j, j);
      for (int k = 0; k < j; ++k) pivot -= factor_(j, k) * factor_(j, k);
      if (!(pivot > 1e-9 * normal(j, j))) return false;
      factor_(j, j) = std::sqrt(pivot);
      for (int i = j + 1; i < size_; ++i) {
        double sum = normal(i, j);
        for (int k = 0; k < j; ++k) sum -= factor_(i, k) * factor_(j, k);
        factor_(i, j) = sum / factor_(j, j);
      }
    }
    return true;
  }
  [[nodiscard]] Vector5 solve(Vector5 b) const {
    for (int i = 0; i < size_; ++i) {
      for (int k = 0; k < i; ++k) b(i) -= factor_(i, k) * b(k);
      b(i) /= factor_(i, i);
    }
    for (int i = size_ - 1; i >= 0; --i) {
      for (int k = i + 1; k < size_; ++k) b(i) -= factor_(k, i) * b(k);
      b(i) /= factor_(i, i);
    }
    b.tail(5 - size_).setZero();
    return b;
  }
  Matrix5 factor_;
  int size_ = 5;
};

}  // namespace

const Directions& directions(int count) {
  static const auto tables = [] {
    std::array<Directions, Rays::most / 16 + 1> all{};
    for (std::size_t sixteens = 1; sixteens < all.size(); ++sixteens)
      for (std::size_t i = 0; i < 16 * sixteens; ++i) {
        // Half a step off the axes, so that no ray runs along a row of pixels.
        const double angle =
            2.0 * std::numbers::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(16 * sixteens);
        Directions& d = all[sixteens];
        d.c[i] = std::cos(angle), d.s[i] = std::sin(angle);
        d.c2[i] = std::cos(2.0 * angle), d.s2[i] = std::sin(2.0 * angle);
        for (std::size_t m = 0; m < 4; ++m) {
          const double multiple = static_cast<double>(m + 1) * angle;
          d.powers[i][2 * m] = std::cos(multiple), d.powers[i][2 * m + 1] = std::sin(multiple);
        }
      }
    return all;
  }();
  return tables[static_cast<std::size_t>(count / 16)];
}

double radius_at(const Shape& shape, const Directions& d, std::size_t i) {
  return shape.radius + shape.cos2 * d.c2[i] + shape.sin2 * d.s2[i];
}

double median_of(Values& values, int count) {
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

bool half_reach(const Values& values, int count, double limit) {
  int reached = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) reached += values[i] >= limit;
  return 2 * reached >= count;
}

bool fit_shape(Rays& rays, const std::array<bool, Rays::most>& usable, double floor, OutlineFit& fit) {
  const Directions& d = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  int open = 0, used = 0;
  for (std::size_t k = 0; k < count; ++k) {
    open += rays.open[k];
    used += usable[k];
    rays.weight[k] = usable[k] ? 1.0 : 0.0;
    if (!usable[k]) rays.offset[k] = 0.0;
  }
  if (used < 8) return false;
  const bool ellipse = used >= 0.6 * rays.count, all = used == rays.count;
  Values sizes, rest;
  const auto residuals = [&](const Vector5& p) {
    for (std::size_t k = 0; k < count; ++k)
      rest[k] = rays.offset[k] - (p(0) + p(1) * d.c[k] + p(2) * d.s[k] + p(3) * d.c2[k] + p(4) * d.s2[k]);
    std::size_t n = 0;
    for (std::size_t k = 0; k < count; ++k) {
      sizes[n] = std::abs(rest[k]);
      n += usable[k];
    }
    return static_cast<int>(n);
  };
  HarmonicFit harmonic;
  Vector5 p;
  bool solved = true;
  if (all) {  // over the full circle the harmonics are orthogonal
    p.setZero();
    for (std::size_t k = 0; k < count; ++k) {
      const double r = rays.offset[k];
      p(0) += 0.5 * r, p(1) += r * d.c[k], p(2) += r * d.s[k], p(3) += r * d.c2[k], p(4) += r * d.s2[k];
    }
    p *= 2.0 / used;
  } else {
    solved = harmonic.fit(d, rays.weight, rays.offset, count, ellipse);
    p = harmonic.solution;
  }
  int n = residuals(p);
  const double largest = *std::max_element(sizes.begin(), sizes.begin() + n);
  constexpr double normal = 1.4826;  // deviation over the median of the sizes
  const bool foreign =
      !solved || !p.allFinite() || (largest > 3.7 * floor && !half_reach(sizes, n, largest / (3.7 * normal)));
  if (foreign) {
    p.setZero();
    n = residuals(p);
    double scale = std::max(floor, normal * median_of(sizes, n));
    const bool near =
        scale < 0.2;  // px; as from the second fit of a drop on: what does not belong shows at once
    if (!near) {      // the median is a safe start
      n = 0;
      for (std::size_t k = 0; k < count; ++k)
        if (usable[k]) sizes[static_cast<std::size_t>(n++)] = rays.offset[k];
      p(0) = median_of(sizes, n);
    }
    for (int round = near ? 4 : 0; round < 14; ++round) {
      n = residuals(p);
      const double previous = scale;
      scale = std::max(floor, normal * median_of(sizes, n));
      // Cauchy's weight while far off keeps every ray's say; Tukey's drops what does not belong.
      const double cauchy = 1.0 / std::pow(2.4 * scale, 2), tukey = 1.0 / std::pow(4.7 * scale, 2);
      if (round < 4)
        for (std::size_t k = 0; k < count; ++k)
          rays.weight[k] = (usable[k] ? 1.0 : 0.0) / (1.0 + cauchy * rest[k] * rest[k]);
      else
        for (std::size_t k = 0; k < count; ++k) {
          const double share = std::max(0.0, 1.0 - tukey * rest[k] * rest[k]);
          rays.weight[k] = (usable[k] ? 1.0 : 0.0) * share * share;
        }
      if (!harmonic.fit(d, rays.weight, rest, count, ellipse)) return false;
      p += harmonic.solution;
      if (round >= 5 && harmonic.solution.norm() < 3e-3 && std::abs(scale - previous) < 0.1 * scale) break;
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
  fit.moved = std::abs(p(0)) + p.segment<2>(1).norm() + p.tail<2>().norm();
  fit.sigma = fit.residual * std::sqrt(all && !foreign ? 2.0 / used : harmonic.variance());
  fit.shape.x += p(1);
  fit.shape.y += p(2);
  fit.shape.radius += p(0);
  fit.shape.cos2 += p(3);
  fit.shape.sin2 += p(4);
  return fit.shape.radius > 0.5;
}

}  // namespace invar::vision
