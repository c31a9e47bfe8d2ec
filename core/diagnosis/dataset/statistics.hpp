// Medians, robust spreads and the colour of noise.
#pragma once

#include <vector>

namespace invar::diagnosis {

/// NaN are skipped; NaN where nothing else is there.
double median(std::vector<double> values);
/// 1.4826 times the median absolute deviation; NaN are skipped.
double robust_sigma(const std::vector<double>& values);
/// The noise of a slowly changing signal from its second differences, robust; NaN are skipped.
double spread_of_differences(const std::vector<double>& values);

/// An autoregression e[t] = r[t] - sum a[j] r[t-1-j] that makes coloured noise white, with the size of e.
struct Whitening {
  std::vector<double> a;
  double sigma = 1.0;
};

/// Fitted to a residual that is mostly noise (Yule-Walker, order by Akaike up to `most`); NaN are skipped, single large
/// values clipped.
Whitening fit_whitening(const std::vector<std::vector<double>>& series, std::size_t most);

/// e / sigma; 0 where r is NaN. A missing value counts as predicted by those before it.
void whiten(const Whitening& filter, const std::vector<double>& r, const std::vector<bool>& present,
            double* out);

/// The number of independent values that a correlated series is worth, as a share of its values. It is 1 / (1 + 2 sum of its
/// autocorrelations), summed in pairs until a pair is not positive (Geyer 1992); NaN are skipped.
double independent_share(const std::vector<std::vector<double>>& series);

/// Upper tail of the standard normal distribution.
double normal_tail(double z);

}  // namespace invar::diagnosis
