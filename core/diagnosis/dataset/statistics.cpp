#include "core/diagnosis/dataset/statistics.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/numerics/robust.hpp"

namespace invar::diagnosis {

double median(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  return numerics::median(std::move(values));
}

double robust_sigma(const std::vector<double>& values) {
  const double center = median(values);
  if (!std::isfinite(center)) return 0.0;
  auto apart = values;
  for (double& v : apart) v = std::abs(v - center);
  return 1.4826 * median(std::move(apart));
}

double spread_of_differences(const std::vector<double>& values) {
  std::vector<double> second;
  for (std::size_t i = 2; i < values.size(); ++i)
    second.push_back((values[i] - 2.0 * values[i - 1] + values[i - 2]) / std::sqrt(6.0));
  return robust_sigma(second);
}

Whitening fit_whitening(const std::vector<std::vector<double>>& series, std::size_t most) {
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

  std::vector<double> covariance(most + 1, 0.0);
  for (std::size_t lag = 0; lag <= most; ++lag) {
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
  return result;
}

void whiten(const Whitening& filter, const std::vector<double>& r, const std::vector<bool>& present,
            double* out) {
  const auto order = std::ssize(filter.a), rows = std::ssize(r);
  const Eigen::Map<const Eigen::ArrayXd> a{filter.a.data(), order}, read{r.data(), rows};
  Eigen::Map<Eigen::ArrayXd> white{out, rows};
  Eigen::ArrayXd known = Eigen::ArrayXd::Zero(rows);
  white.setZero();
  for (std::ptrdiff_t begin = 0, end = 0; begin < rows; begin = end) {
    const bool is_present = present[static_cast<std::size_t>(begin)];
    end = std::find(present.begin() + begin, present.begin() + rows, !is_present) - present.begin();
    if (!is_present) {  // as the rows before foretell
      for (std::ptrdiff_t i = begin; i < end; ++i)
        for (std::ptrdiff_t j = 0; j < std::min(order, i); ++j) known(i) += a(j) * known(i - 1 - j);
      continue;
    }
    known.segment(begin, end - begin) = white.segment(begin, end - begin) = read.segment(begin, end - begin);
    // Of zeros only zeros come: a column that acts in one window is looked at there.
    const auto acts = [&](std::ptrdiff_t i) { return known(i) != 0.0; };
    std::ptrdiff_t first = std::max<std::ptrdiff_t>(0, begin - order), last = end;
    while (first < end && !acts(first)) ++first;
    while (last > first && !acts(last - 1)) --last;
    // A sum of shifted copies, piece by piece while they are at hand, so that several rows are added at a time.
    constexpr std::ptrdiff_t piece = 512;
    const auto until = std::min(end, last + order);
    for (auto from = std::max(begin, first); from < until; from += piece) {
      const auto to = std::min(until, from + piece);
      for (std::ptrdiff_t j = 0; j < order; ++j)
        if (const auto at = std::max(from, j + 1); at < to)
          white.segment(at, to - at) -= a(j) * known.segment(at - 1 - j, to - at);
      white.segment(from, to - from) /= filter.sigma;
    }
  }
}

double independent_share(const std::vector<std::vector<double>>& series) {
  double mean = 0.0, count = 0.0;
  std::size_t longest = 0;
  for (const auto& one : series) {
    longest = std::max(longest, one.size());
    for (double v : one)
      if (std::isfinite(v)) mean += v, count += 1.0;
  }
  if (count < 8.0) return 1.0;
  mean /= count;
  const auto covariance = [&](std::size_t lag) {
    double sum = 0.0, n = 0.0;
    for (const auto& one : series)
      for (std::size_t i = lag; i < one.size(); ++i)
        if (std::isfinite(one[i]) && std::isfinite(one[i - lag]))
          sum += (one[i] - mean) * (one[i - lag] - mean), n += 1.0;
    return n > 0.0 ? sum / n : 0.0;
  };
  const double variance = covariance(0);
  if (!(variance > 0.0)) return 1.0;
  double sum = 0.0;
  for (std::size_t lag = 1; lag + 1 < longest / 4; lag += 2) {
    const double pair = (covariance(lag) + covariance(lag + 1)) / variance;
    if (pair <= 0.0) break;
    sum += pair;
  }
  return 1.0 / (1.0 + 2.0 * sum);
}

double normal_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

}  // namespace invar::diagnosis
