#include "core/vision/outline.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "core/vision/outline_curve.hpp"
#include "core/vision/ray_samples.hpp"

namespace invar::vision {

namespace {

constexpr double chance =
    2.0;  // so many times what chance makes of a square on average is still taken for chance

// Where the samples of eight rays lie, from `inward` px inside the shape to `outward` px outside; rays that leave the image are
// closed. `whole`: none does. False where no ray is open.
bool prepare(const RaySamples& samples, const Shape& shape, const Directions& d, std::size_t first,
             double inward, double outward, bool whole, Rays& rays, EightRays& block) {
  if (std::none_of(&rays.open[first], &rays.open[first] + lanes, [](bool open) { return open; }))
    return false;
  std::memcpy(block.step_u.data(), &d.step_u[first], sizeof block.step_u);
  std::memcpy(block.step_v.data(), &d.step_v[first], sizeof block.step_v);
  const auto x = static_cast<std::int32_t>(shape.x * EightRays::unit),
             y = static_cast<std::int32_t>(shape.y * EightRays::unit);
  const auto mean = static_cast<float>((shape.radius - inward) * EightRays::unit),
             cos2 = static_cast<float>(shape.cos2 * EightRays::unit),
             sin2 = static_cast<float>(shape.sin2 * EightRays::unit);
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t k = first + lane;
    const float begin = mean + cos2 * d.c2[k] + sin2 * d.s2[k];
    block.u[lane] = x + static_cast<std::int32_t>(begin * d.c[k]);
    block.v[lane] = y + static_cast<std::int32_t>(begin * d.s[k]);
  }
  if (whole) return true;
  bool any = false;
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t k = first + lane;
    const double u = block.u[lane] / EightRays::unit, v = block.v[lane] / EightRays::unit,
                 length = inward + outward;
    rays.open[k] =
        rays.open[k] && samples.holds(u, v) &&
        samples.holds(u + length * static_cast<double>(d.c[k]), v + length * static_cast<double>(d.s[k]));
    any = any || rays.open[k];
    if (rays.open[k]) continue;
    rays.weight[k] = 0.0F;
    block.u[lane] = block.v[lane] = block.step_u[lane] = block.step_v[lane] = 0;
  }
  return any;
}

// Whether all rays stay inside the image.
bool stays_inside(const RaySamples& samples, const Shape& shape, double outward) {
  const double largest = shape.radius + std::abs(shape.cos2) + std::abs(shape.sin2) + outward + 0.1;
  return samples.holds(shape.x, shape.y, largest);
}

}  // namespace

void Rays::choose(double radius) {
  count = 16 * std::clamp(static_cast<int>(std::lround(radius * std::numbers::pi / 20.0)), 1, most / 16);
  std::fill_n(open.begin(), count, true);
  std::fill_n(weight.begin(), count, 1.0F);
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
    const auto c = static_cast<double>(d.c[i]), s = static_cast<double>(d.s[i]);
    const double along = std::clamp(dx * c + dy * s, r - 0.5 * reach, r + reach);
    const double away_x = dx - along * c, away_y = dy - along * s;
    if (away_x * away_x + away_y * away_y < limit * limit) open[i] = false, weight[i] = 0.0F;
  }
}

OutlineFit seek_outline(const cv::Mat& image, const Shape& shape, int polarity, double reach, Rays& rays) {
  const RaySamples samples{image};
  const Directions& d = directions(rays.count);
  const int half = std::clamp(static_cast<int>(std::ceil(reach)), 3, 30);
  const int inward = std::min(half, static_cast<int>(shape.radius - std::hypot(shape.cos2, shape.sin2)));
  const auto length = static_cast<std::size_t>(inward + half + 5);
  const bool whole = stays_inside(samples, shape, half + 2);
  std::array<Lanes, 65> f, slope;
  EightRays block;
  std::array<std::int32_t, lanes> steepest;
  Values heights, sorted, usable;  // written before they are read
  int n = 0;
  for (std::size_t first = 0; first < static_cast<std::size_t>(rays.count); first += lanes) {
    std::fill_n(&usable[first], lanes, 0.0F);
    if (!prepare(samples, shape, d, first, inward + 2, half + 2, whole, rays, block)) continue;
    samples.read(block, length, f.data());
    find_steps(f.data(), length, static_cast<float>(polarity), static_cast<float>(inward + 2),
               static_cast<float>(reach), slope.data(), steepest);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::size_t k = first + lane;
      if (!rays.open[k] || steepest[lane] < 0) continue;
      const auto at = static_cast<std::size_t>(steepest[lane]);
      const float height = slope[at][lane];
      float fraction = 0.0F;
      if (at > 2 && at + 3 < length) {
        const float before = slope[at - 1][lane], after = slope[at + 1][lane],
                    bend = before - 2.0F * height + after;
        if (bend < 0.0F) fraction = std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F);
      }
      rays.offset[k] = static_cast<float>(steepest[lane] - 2 - inward) + fraction;
      heights[k] = sorted[static_cast<std::size_t>(n++)] = height;
      usable[k] = 1.0F;
    }
  }
  OutlineFit fit;
  fit.shape = shape;
  if (n < 8) return fit;
  fit.contrast = median_of(sorted, n);
  const auto least = static_cast<float>(0.35 * fit.contrast);
  for (std::size_t k = 0; k < static_cast<std::size_t>(rays.count); ++k)
    if (usable[k] > 0.0F && heights[k] < least) usable[k] = 0.0F;
  fit.valid = fit_shape(rays, usable, 0.35, fit);
  return fit;
}

OutlineFit refine_outline(const cv::Mat& image, const Shape& shape, int polarity, const EdgeFilter& filter,
                          Rays& rays) {
  const RaySamples samples{image};
  const Directions& d = directions(rays.count);
  const auto count = static_cast<std::size_t>(rays.count);
  const auto length = static_cast<std::size_t>(2 * filter.half + 1);
  const bool whole = stays_inside(samples, shape, filter.half);
  Values usable;  // written before they are read, as the next three
  std::array<RayProducts, Rays::most / lanes> products;
  std::array<Lanes, EdgeFilter::most> f;
  EightRays block;
  constexpr std::size_t common_rows = EdgeFilter::rows - EdgeFilter::to_slope_in;
  std::array<std::array<Lanes, 3>, common_rows> by_lane{};  // products over the rays, by 1, c, s
  std::array<Lanes, 2> squares{};                           // of the products with the slopes' rows
  std::array<Lanes, 6> weights{};  // over the rays: their sum, by c, s, c c, c s, s s
  for (std::size_t first = 0; first < count; first += lanes) {
    const bool any = prepare(samples, shape, d, first, filter.half, filter.half, whole, rays, block);
    for (std::size_t k = first; k < first + lanes; ++k) usable[k] = rays.open[k] ? 1.0F : 0.0F;
    if (!any) continue;
    std::array<Lanes, 3> harmonic;
    Lanes c, s;
    std::memcpy(&harmonic[0], &rays.weight[first], sizeof c);
    std::memcpy(&c, &d.c[first], sizeof c);
    std::memcpy(&s, &d.s[first], sizeof s);
    harmonic[1] = harmonic[0] * c;
    harmonic[2] = harmonic[0] * s;
    for (std::size_t m = 0; m < 3; ++m) weights[m] += harmonic[m];
    weights[3] += harmonic[1] * c, weights[4] += harmonic[1] * s, weights[5] += harmonic[2] * s;
    samples.read(block, length, f.data());
    take_products(f.data(), filter, products[first / lanes]);
    for (std::size_t row = 0; row < common_rows; ++row)
      for (std::size_t m = 0; m < 3; ++m)
        by_lane[row][m] += harmonic[m] * products[first / lanes].rows[EdgeFilter::to_slope_in + row];
    for (std::size_t side = 0; side < squares.size(); ++side) {
      const Lanes& slope = products[first / lanes].rows[EdgeFilter::to_slope_in + side];
      squares[side] += harmonic[0] * slope * slope;
    }
  }
  Eigen::Matrix3d normal;
  normal(0, 0) = sum_of(weights[0]), normal(0, 1) = sum_of(weights[1]), normal(0, 2) = sum_of(weights[2]);
  normal(1, 1) = sum_of(weights[3]), normal(1, 2) = sum_of(weights[4]), normal(2, 2) = sum_of(weights[5]);
  OutlineFit fit;
  fit.shape = shape;
  if (!(normal(0, 0) > 5.0)) return fit;
  normal(1, 0) = normal(0, 1), normal(2, 0) = normal(0, 2), normal(2, 1) = normal(1, 2);

  // What the drop has in common: the profile over the angle as constant and first harmonic, its slopes by the sloped step, and
  // its mean, less the slopes, as a step of another blur. All of it is linear in the samples, so in their products.
  const Eigen::Matrix3d inverse = normal.inverse();
  const auto sums_of = [&](EdgeFilter::Row row) -> Eigen::Vector3d {
    const auto& sums = by_lane[row - EdgeFilter::to_slope_in];
    return {sum_of(sums[0]), sum_of(sums[1]), sum_of(sums[2])};
  };
  const auto over_the_angle = [&](EdgeFilter::Row row) -> Eigen::Vector3d { return inverse * sums_of(row); };
  // A slope across the drop moves its edge as a shift of the centre does. Where the rays' own slopes scatter by as much,
  // there is none, and taking it off would only add its noise to the centre.
  const auto slopes = [&](EdgeFilter::Row row) {
    const Eigen::Vector3d sums = sums_of(row);
    Eigen::Vector3d found = inverse * sums;
    const double rest = sum_of(squares[row - EdgeFilter::to_slope_in]) - found.dot(sums);
    const double by_chance = rest / (normal(0, 0) - 3.0) * (inverse(1, 1) + inverse(2, 2));
    const double across = found.tail<2>().squaredNorm();
    found.tail<2>() *= across > chance * by_chance ? 1.0 - chance * by_chance / across : 0.0;
    return found;
  };
  const Eigen::Vector3d inside = slopes(EdgeFilter::to_slope_in), outside = slopes(EdgeFilter::to_slope_out);
  const Eigen::Vector2d spread = Eigen::Vector2d{over_the_angle(EdgeFilter::to_spread_height)(0),
                                                 over_the_angle(EdgeFilter::to_spread_blur)(0)} -
                                 inside(0) * filter.spread_inner - outside(0) * filter.spread_outer;
  const double height = spread(0), wider = spread(1) / spread(0);
  fit.contrast = polarity * height;
  if (!(fit.contrast > 0.0)) return fit;
  fit.blur = std::clamp(filter.blur + wider, 0.5 * filter.blur, 2.0 * filter.blur);

  const auto number = [](double value) { return static_cast<float>(value); };
  const EdgeRule rule{{number(inside(0)), number(inside(1)), number(inside(2))},
                      {number(outside(0)), number(outside(1)), number(outside(2))},
                      static_cast<float>(polarity),
                      number(0.4 * fit.contrast),
                      number(2.5 * fit.contrast),
                      number(2.0 * filter.blur + 0.5)};  // the linear step reaches no farther
  Values misfit;                                         // written before it is read
  for (std::size_t first = 0; first < count; first += lanes) {
    if (std::none_of(&rays.open[first], &rays.open[first] + lanes, [](bool open) { return open; })) {
      std::fill_n(&misfit[first], lanes, 0.0F);
      continue;
    }
    RayEdges edges;
    place_edges(products[first / lanes], filter, rule, &d.c[first], &d.s[first], edges);
    Lanes trusted;
    std::memcpy(&trusted, &usable[first], sizeof trusted);
    trusted *= edges.sound;
    edges.misfit *= trusted;
    std::memcpy(&usable[first], &trusted, sizeof trusted);
    std::memcpy(&rays.offset[first], &edges.offset, sizeof edges.offset);
    std::memcpy(&misfit[first], &edges.misfit, sizeof edges.misfit);
  }
  // A scratch or a speck across the ray spoils its profile before it moves its edge.
  const double typical = (largest_of(misfit, rays.count) - 0.03 * fit.contrast) / 2.5;
  if (typical > 0.0 &&
      2 * reaching(misfit, rays.count, typical) < reaching(usable, rays.count, 0.5)) {  // the median is less
    Values sorted;
    int n = 0;
    for (std::size_t k = 0; k < count; ++k)
      if (usable[k] > 0.0F) sorted[static_cast<std::size_t>(n++)] = misfit[k];
    const auto limit = number(2.5 * median_of(sorted, n) + 0.03 * fit.contrast);
    for (std::size_t k = 0; k < count; ++k)
      if (misfit[k] > limit) usable[k] = 0.0F;
  }
  fit.valid = fit_shape(rays, usable, 0.015, fit);
  return fit;
}

}  // namespace invar::vision
