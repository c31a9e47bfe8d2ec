// Medians, robust spreads and the colour of noise.
#pragma once

#include <vector>

namespace invar::diagnose {

double median(std::vector<double> values);
/// 1.4826 times the median absolute deviation; NaN are skipped.
double robust_sigma(const std::vector<double>& values);
/// The noise of a slowly changing signal from its second differences, robust; NaN are skipped.
double spread_of_differences(const std::vector<double>& values);

/// An autoregression e[t] = r[t] - sum a[j] r[t-1-j] - sum b[w] mean(r[t-to..t-from]) that makes coloured noise white,
/// with the size of e. The means are for what wanders slowly under white noise (Corsi's heterogeneous autoregression).
struct Whitening {
  struct Past {
    std::size_t from, to;
  };
  std::vector<double> a;
  double sigma = 1.0;
  std::vector<Past> windows;
  std::vector<double> b;
};

/// Fitted to a residual that is mostly noise (Yule-Walker, order by Akaike up to `most`; with `far` also means over
/// older rows, where there are rows enough and they say something); NaN are skipped, single large values clipped.
Whitening fit_whitening(const std::vector<std::vector<double>>& series, std::size_t most, bool far = false);

/// e / sigma; 0 where r is NaN. A missing value counts as predicted by those before it.
void whiten(const Whitening& filter, const std::vector<double>& r, const std::vector<bool>& present,
            double* out);

/// Upper tail of the standard normal distribution.
double normal_tail(double z);

}  // namespace invar::diagnose
