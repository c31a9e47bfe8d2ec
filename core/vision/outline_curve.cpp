#include "core/vision/outline_curve.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "core/vision/ray_samples.hpp"
#include "core/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

void load(const float* from, Lanes& to) { std::memcpy(&to, from, sizeof to); }

// Sums over rays of the weights and of weight * r, each by the harmonics of the angle.
struct HarmonicMoments {
  enum : std::size_t { one, c1, s1, c2, s2, c3, s3, c4, s4, of_weights };
  std::array<double, of_weights> weights;
  std::array<double, c3> values;  // up to the double angle
};

INVAR_WIDE_VECTORS
void add_up(const Directions& d, const Values& weight, const Values& r, std::size_t count,
            HarmonicMoments& moments) {
  constexpr std::size_t of_values = HarmonicMoments::c3;
  std::array<Lanes, HarmonicMoments::of_weights> of_weight{};
  std::array<Lanes, of_values> of_value{};
  const std::array<const Values*, HarmonicMoments::of_weights> harmonics{nullptr, &d.c,  &d.s,  &d.c2, &d.s2,
                                                                         &d.c3,   &d.s3, &d.c4, &d.s4};
  for (std::size_t k = 0; k < count; k += lanes) {
    Lanes w, v, h;
    load(weight.data() + k, w);
    load(r.data() + k, v);
    v *= w;
    of_weight[0] += w;
    of_value[0] += v;
    for (std::size_t m = 1; m < HarmonicMoments::of_weights; ++m) {
      load(harmonics[m]->data() + k, h);
      of_weight[m] += w * h;
      if (m < of_values) of_value[m] += v * h;
    }
  }
  for (std::size_t m = 0; m < of_weight.size(); ++m) moments.weights[m] = sum_of(of_weight[m]);
  for (std::size_t m = 0; m < of_values; ++m) moments.values[m] = sum_of(of_value[m]);
}

// Sums over rays of r by the harmonics up to the double angle, each ray alike.
INVAR_WIDE_VECTORS
void add_up_alike(const Directions& d, const Values& r, std::size_t count, std::array<double, 5>& sums) {
  std::array<Lanes, 5> lane{};
  const std::array<const Values*, 5> harmonics{nullptr, &d.c, &d.s, &d.c2, &d.s2};
  for (std::size_t k = 0; k < count; k += lanes) {
    Lanes v, h;
    load(r.data() + k, v);
    lane[0] += v;
    for (std::size_t m = 1; m < lane.size(); ++m) {
      load(harmonics[m]->data() + k, h);
      lane[m] += v * h;
    }
  }
  for (std::size_t m = 0; m < lane.size(); ++m) sums[m] = sum_of(lane[m]);
}

// What the curve leaves of the usable offsets; 0 elsewhere.
INVAR_WIDE_VECTORS
void leave(const Directions& d, const Values& offset, const Values& usable, const Vector5& curve,
           std::size_t count, Values& rest) {
  std::array<float, 5> p;
  for (std::size_t m = 0; m < 5; ++m) p[m] = static_cast<float>(curve(static_cast<Eigen::Index>(m)));
  for (std::size_t k = 0; k < count; ++k)
    rest[k] =
        usable[k] * (offset[k] - (p[0] + p[1] * d.c[k] + p[2] * d.s[k] + p[3] * d.c2[k] + p[4] * d.s2[k]));
}

// Cauchy's weights while far off keep every ray's say; Tukey's drop what does not belong.
INVAR_WIDE_VECTORS
void weigh_by_cauchy(const Values& rest, const Values& usable, float factor, std::size_t count,
                     Values& weight) {
  for (std::size_t k = 0; k < count; ++k) weight[k] = usable[k] / (1.0F + factor * rest[k] * rest[k]);
}
INVAR_WIDE_VECTORS
void weigh_by_tukey(const Values& rest, const Values& usable, float factor, std::size_t count,
                    Values& weight) {
  for (std::size_t k = 0; k < count; ++k) {
    const float share = 1.0F - factor * rest[k] * rest[k];
    weight[k] = share > 0.0F ? usable[k] * share * share : 0.0F;
  }
}

// Sum of the weights, of weight * rest^2, and how many weigh more than 0.2.
struct Agreement {
  double weight, square;
  int agree;
};
INVAR_WIDE_VECTORS
Agreement agreement_of(const Values& weight, const Values& rest, std::size_t count) {
  Lanes sum{}, square{}, agree{};
  for (std::size_t k = 0; k < count; k += lanes) {
    Lanes w, r;
    load(weight.data() + k, w);
    load(rest.data() + k, r);
    sum += w;
    square += w * r * r;
    agree += w > 0.2F ? Lanes{} + 1.0F : Lanes{};
  }
  return {sum_of(sum), sum_of(square), static_cast<int>(sum_of(agree))};
}

// Weighted least squares of a + b cos + c sin + d cos2 + e sin2; without the last two where an arc is too short to tell an
// ellipse from a shift.
class HarmonicFit {
 public:
  /// False where the rays do not determine the curve.
  [[nodiscard]] bool fit(const Directions& d, const Values& weight, const Values& r, std::size_t count,
                         bool ellipse) {
    HarmonicMoments moments;
    add_up(d, weight, r, count, moments);
    const auto& [w0, c1, s1, c2, s2, c3, s3, c4, s4] = moments.weights;
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
    for (Eigen::Index m = 0; m < 5; ++m) right(m) = moments.values[static_cast<std::size_t>(m)];
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
        const std::array<std::pair<Values*, Values*>, 4> multiples{
            {{&d.c, &d.s}, {&d.c2, &d.s2}, {&d.c3, &d.s3}, {&d.c4, &d.s4}}};
        for (std::size_t m = 0; m < 4; ++m) {
          const double multiple = static_cast<double>(m + 1) * angle;
          (*multiples[m].first)[i] = static_cast<float>(std::cos(multiple));
          (*multiples[m].second)[i] = static_cast<float>(std::sin(multiple));
        }
        d.step_u[i] = static_cast<std::int32_t>(std::lround(65536.0 * std::cos(angle)));
        d.step_v[i] = static_cast<std::int32_t>(std::lround(65536.0 * std::sin(angle)));
      }
    return all;
  }();
  return tables[static_cast<std::size_t>(count / 16)];
}

double radius_at(const Shape& shape, const Directions& d, std::size_t i) {
  return shape.radius + shape.cos2 * static_cast<double>(d.c2[i]) + shape.sin2 * static_cast<double>(d.s2[i]);
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
  return static_cast<double>(*middle);
}

INVAR_WIDE_VECTORS
double largest_of(const Values& values, int count) {
  Lanes largest{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); k += lanes) {
    Lanes v;
    load(values.data() + k, v);
    v = v < 0.0F ? -v : v;
    largest = v > largest ? v : largest;
  }
  float most = 0.0F;
  for (std::size_t lane = 0; lane < lanes; ++lane) most = std::max(most, largest[lane]);
  return static_cast<double>(most);
}

INVAR_WIDE_VECTORS
int reaching(const Values& values, int count, double limit) {
  const auto least = static_cast<float>(limit);
  Lanes reached{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); k += lanes) {
    Lanes v;
    load(values.data() + k, v);
    reached += (v < 0.0F ? -v : v) >= least ? Lanes{} + 1.0F : Lanes{};
  }
  return static_cast<int>(sum_of(reached));
}

bool fit_shape(Rays& rays, const Values& usable, double floor, OutlineFit& fit) {
  const Directions& d = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  int open = 0;
  for (std::size_t k = 0; k < count; ++k) open += rays.open[k];
  const int used = reaching(usable, rays.count, 0.5);
  if (used < 8) return false;
  std::copy_n(usable.begin(), count, rays.weight.begin());
  const bool ellipse = used >= 0.6 * rays.count, all = used == rays.count;
  Values sizes, rest;  // written before they are read
  const auto sizes_of = [&](const Values& values) {
    std::size_t n = 0;
    for (std::size_t k = 0; k < count; ++k) {
      sizes[n] = std::abs(values[k]);
      n += usable[k] > 0.0F;
    }
    return static_cast<int>(n);
  };
  HarmonicFit harmonic;
  Vector5 p = Vector5::Zero();
  bool solved = true;
  if (all) {  // over the full circle the harmonics are orthogonal
    std::array<double, 5> sums;
    add_up_alike(d, rays.offset, count, sums);
    for (Eigen::Index m = 0; m < 5; ++m)
      p(m) = (m == 0 ? 1.0 : 2.0) / used * sums[static_cast<std::size_t>(m)];
  } else {
    solved = harmonic.fit(d, rays.weight, rays.offset, count, ellipse);
    p = harmonic.solution;
  }
  constexpr double normal = 1.4826;  // deviation over the median of the sizes
  leave(d, rays.offset, usable, p, count, rest);
  const double largest = largest_of(rest, rays.count);
  const bool foreign =
      !solved || !p.allFinite() ||
      (largest > 3.7 * floor && 2 * reaching(rest, rays.count, largest / (3.7 * normal)) < used);
  if (foreign) {
    p.setZero();
    double scale = std::max(floor, normal * median_of(sizes, sizes_of(rays.offset)));
    const bool near =
        scale < 0.2;  // px; as from the second fit of a drop on: what does not belong shows at once
    if (!near) {      // the median is a safe start
      std::size_t n = 0;
      for (std::size_t k = 0; k < count; ++k)
        if (usable[k] > 0.0F) sizes[n++] = rays.offset[k];
      p(0) = median_of(sizes, used);
    }
    for (int round = near ? 4 : 0; round < 14; ++round) {
      leave(d, rays.offset, usable, p, count, rest);
      const double previous = scale;
      if (round < 6)  // then it stands, and the weights settle soon
        scale = std::max(floor, normal * median_of(sizes, sizes_of(rest)));
      if (round < 4)
        weigh_by_cauchy(rest, usable, static_cast<float>(1.0 / std::pow(2.4 * scale, 2)), count, rays.weight);
      else
        weigh_by_tukey(rest, usable, static_cast<float>(1.0 / std::pow(4.7 * scale, 2)), count, rays.weight);
      if (!harmonic.fit(d, rays.weight, rest, count, ellipse)) return false;
      p += harmonic.solution;
      if (round >= 5 && harmonic.solution.norm() < 3e-3 && std::abs(scale - previous) < 0.1 * scale) break;
    }
    leave(d, rays.offset, usable, p, count, rest);
  }
  const Agreement found = agreement_of(rays.weight, rest, count);
  if (!(found.weight > 5.0)) return false;
  fit.residual = std::sqrt(found.square / (found.weight - 5.0 + 1e-9));
  fit.support = found.agree / static_cast<double>(std::max(1, open));
  fit.coverage = found.agree / static_cast<double>(rays.count);
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
