// Significance: how likely chance alone is to make a fit better, or neighbours alike.
#pragma once

#include <vector>

namespace invar::numerics {

/// Probability that an F statistic of `numerator` and `denominator` degrees of freedom exceeds `f`.
/// F(5, 10) exceeds 3.3258 with a probability of 0.05.
double f_tail(double f, double numerator, double denominator);

/// Probability that `extra` further numbers lower the sum of squares of white residuals at least from `without` to `with`.
/// `freedom` degrees of freedom are left with them. 1 where that cannot be told.
double chance_of_gain(double without, double with, double extra, double freedom);

/// Probability that independent values, in the order given, have a lag-one correlation as large as these: low where
/// something goes on from one to the next. 1 for fewer than ten.
double chance_of_alike_neighbours(const std::vector<double>& values);

}  // namespace invar::numerics
