// Robust statistics: median, scale from the median absolute deviation, and the test for normality.
#pragma once

#include <vector>

namespace invar::numerics {

/// The median; the mean of the two middle values of an even number. NaN for none.
double median(std::vector<double> values);

/// Standard deviation estimated from the median absolute deviation about `centre`: 1.4826 * MAD. Half of the
/// values may be outliers. Zero when more than half are equal to `centre`.
double robust_deviation(const std::vector<double>& values, double centre);

struct Normality {
  double statistic = 0.0;    // A*^2, corrected for n: Stephens 1974, mean and variance estimated
  double probability = 1.0;  // of a larger statistic from normal values
};

/// Anderson-Darling test against a normal distribution of unknown mean and variance. At least eight values.
Normality anderson_darling(std::vector<double> values);

}  // namespace invar::numerics
