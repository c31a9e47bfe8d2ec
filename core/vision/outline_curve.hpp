// The smooth closed curve through the edges that rays found.
#pragma once

#include <array>
#include <cstdint>

#include "core/vision/outline.hpp"

namespace invar::vision {

using Values = std::array<float, Rays::most>;  // one a ray

struct Directions {
  // Cosine and sine of the angle, its double, triple and fourfold.
  Values c, s, c2, s2, c3, s3, c4, s4;
  std::array<std::int32_t, Rays::most> step_u, step_v;  // along the ray, 1/65536 px a px
};

/// For each number of rays that is used: multiples of 16.
const Directions& directions(int count);

double radius_at(const Shape& shape, const Directions& directions, std::size_t ray);

/// Median of the first `count` values, which are reordered; of every other one where there are many.
double median_of(Values& values, int count);

/// The largest size among the first `count` values (a multiple of 16).
double largest_of(const Values& values, int count);

/// How many of the first `count` values (a multiple of 16) lie `limit` or more from 0.
int reaching(const Values& values, int count, double limit);

/// The offsets of the usable rays (1; 0 where not) as a smooth curve: least squares where they all agree, else with Tukey's
/// weights. Updates the shape, weights, residual, support and coverage; false where there is none. `floor` is the smallest
/// scale [px] that a residual is judged by.
bool fit_shape(Rays& rays, const Values& usable, double floor, OutlineFit& fit);

}  // namespace invar::vision
