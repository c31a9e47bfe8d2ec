// The smooth closed curve through the edges that rays found.
#pragma once

#include <array>

#include "components/vision/outline.hpp"

namespace invar::vision {

using Values = std::array<double, Rays::most>;  // one a ray

struct Directions {
  Values c, s, c2, s2;  // cosine and sine of the angle and of its double
  std::array<std::array<double, 8>, Rays::most>
      powers;  // a ray: c, s, c2, s2 and those of the triple and fourfold
};

/// For each number of rays that is used: multiples of 16.
const Directions& directions(int count);

double radius_at(const Shape& shape, const Directions& directions, std::size_t ray);

/// Of the first `count` values, which are reordered; of every other one where there are many.
double median_of(Values& values, int count);
/// Whether at least half of the first `count` values reach `limit`: whether their median does, without sorting them.
bool half_reach(const Values& values, int count, double limit);

/// The offsets of the usable rays as a smooth curve: least squares where they all agree, else with Tukey's weights.
/// Updates the shape, weights, residual, support and coverage; false where there is none. `floor` is the smallest scale
/// [px] that a residual is judged by.
bool fit_shape(Rays& rays, const std::array<bool, Rays::most>& usable, double floor, OutlineFit& fit);

}  // namespace invar::vision
