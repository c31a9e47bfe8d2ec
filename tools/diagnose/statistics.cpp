#include "tools/diagnose/statistics.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace invar::diagnose {

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double robust_sigma(const std::vector<double>& values) {
  std::vector<double> finite;
  for (double v : values)
    if (std::isfinite(v)) finite.push_back(v);
  if (finite.empty()) return 0.0;
  const double center = median(finite);
  for (double& v : finite) v = std::abs(v - center);
  return 1.4826 * median(finite);
}

double spread_of_differences(const std::vector<double>& values) {
  std::vector<double> second;
  for (std::size_t i = 2; i < values.size(); ++i)
    second.push_back((values[i] - 2.0 * values[i - 1] + values[i - 2]) / std::sqrt(6.0));
  return robust_sigma(second);
}

namespace {

/// Means over older rows beside the `most` latest ones, where Akaike's number asks for them.
void look_far(const std::vector<double>& covariance, std::size_t most, double count, double akaike,
              Whitening& result) {
  const std::vector<Whitening::Past> windows{{most + 1, 4 * most}, {4 * most + 1, 16 * most}};
  std::vector<Whitening::Past> all;
  for (std::size_t lag = 1; lag <= most; ++lag) all.push_back({lag, lag});
  all.insert(all.end(), windows.begin(), windows.end());
  const auto n = static_cast<Eigen::Index>(all.size());
  const auto between = [&](const Whitening::Past& x, const Whitening::Past& y) {
    double sum = 0.0;
    for (std::size_t i = x.from; i <= x.to; ++i)
      for (std::size_t k = y.from; k <= y.to; ++k) sum += covariance[i > k ? i - k : k - i];
    return sum / static_cast<double>((x.to - x.from + 1) * (y.to - y.from + 1));
  };
  Eigen::MatrixXd m(n, n);
  Eigen::VectorXd v(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& x = all[static_cast<std::size_t>(i)];
    v(i) = between(x, {0, 0});
    for (Eigen::Index k = 0; k <= i; ++k) m(i, k) = m(k, i) = between(x, all[static_cast<std::size_t>(k)]);
  }
  const Eigen::VectorXd weights = m.ldlt().solve(v);
  const double error = covariance[0] - weights.dot(v);
  if (!weights.allFinite() || !(error > 0.0) ||
      count * std::log(error) + 2.0 * static_cast<double>(n) > akaike - 6.0)
    return;
  result.a.assign(weights.data(), weights.data() + most);
  result.b.assign(weights.data() + most, weights.data() + n);
  result.windows = windows;
  result.sigma = std::sqrt(error);
}

}  // namespace

Whitening fit_whitening(const std::vector<std::vector<double>>& series, std::size_t most, bool far) {
  Whitening result;
  std::vector<double> all;
  for (const auto& one : series)
    for (double v : one)
      if (std::isfinite(v)) all.push_back(v);
  if (all.size() < 2) return result;
  double square = 0.0;
  for (double v : all) square += v * v;
  const double rms = std::sqrt(square / static_cast<double>(all.size()));
  const double clip = 5.0 * std::max(robust_sigma(all), 0.2 * rms);
  if (!(clip > 0.0)) return result;
  const auto kept = [clip](double v) { return std::clamp(v, -clip, clip); };

  const bool looks_far = far && most >= 8 && all.size() >= 1500;
  const std::size_t farthest = looks_far ? 16 * most : most;
  std::vector<double> covariance(farthest + 1, 0.0);
  for (std::size_t lag = 0; lag <= farthest; ++lag) {
    double sum = 0.0;
    std::size_t n = 0;
    for (const auto& one : series)
      for (std::size_t i = lag; i < one.size(); ++i)
        if (std::isfinite(one[i]) && std::isfinite(one[i - lag]))
          sum += kept(one[i]) * kept(one[i - lag]), ++n;
    covariance[lag] = n > 0 ? sum / static_cast<double>(n) : 0.0;
  }
  // Levinson's recursion; the order with the least Akaike number.
  std::vector<double> a;
  double error = covariance[0];
  const auto count = static_cast<double>(all.size());
  double best = count * std::log(error);
  result.sigma = std::sqrt(error);
  for (std::size_t k = 1; k <= most; ++k) {
    double reflection = covariance[k];
    for (std::size_t j = 0; j + 1 < k; ++j) reflection -= a[j] * covariance[k - 1 - j];
    reflection /= error;
    if (!(std::abs(reflection) < 0.9999)) break;
    std::vector<double> next(k);
    for (std::size_t j = 0; j + 1 < k; ++j) next[j] = a[j] - reflection * a[k - 2 - j];
    next[k - 1] = reflection;
    a = std::move(next);
    error *= 1.0 - reflection * reflection;
    const double akaike = count * std::log(error) + 2.0 * static_cast<double>(k);
    if (akaike < best - 2.0) {
      best = akaike;
      result.a = a;
      result.sigma = std::sqrt(error);
    }
  }
  if (looks_far) look_far(covariance, most, count, best, result);
  return result;
}

void whiten(const Whitening& filter, const std::vector<double>& r, const std::vector<bool>& present,
            double* out) {
  const std::size_t order = filter.a.size();
  std::vector<double> filled(r.size());
  std::vector<double> sums(filter.windows.empty() ? 0 : r.size() + 1, 0.0);  // of all rows before
  for (std::size_t i = 0; i < r.size(); ++i) {
    double predicted = 0.0;
    for (std::size_t j = 0; j < order && j < i; ++j) predicted += filter.a[j] * filled[i - 1 - j];
    for (std::size_t w = 0; w < filter.windows.size(); ++w) {
      const auto& past = filter.windows[w];
      if (i < past.from) continue;
      const double sum = sums[i - past.from + 1] - sums[i > past.to ? i - past.to : 0];
      predicted += filter.b[w] * sum / static_cast<double>(past.to - past.from + 1);
    }
    filled[i] = present[i] ? r[i] : predicted;
    if (!sums.empty()) sums[i + 1] = sums[i] + filled[i];
    out[i] = present[i] ? (r[i] - predicted) / filter.sigma : 0.0;
  }
}

double normal_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

}  // namespace invar::diagnose
