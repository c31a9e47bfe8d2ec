#include "core/diagnosis/estimate/fit_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/diagnosis/dataset/starts.hpp"

namespace invar::diagnosis {

double Squares::rms() const { return count > 0.0 ? std::sqrt(sum / count) : 0.0; }

namespace {

template <class Counts>
std::vector<Squares> squares_of(const Case& data, const std::vector<physics::Outputs>& simulated,
                                Counts counts) {
  std::vector<Squares> all(data.outputs.size());
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < all.size(); ++o)
      for (std::size_t i = 0; i < simulated[r][o].size(); ++i)
        if (counts(r, o, i))
          all[o] += {std::pow(data.recordings[r].measured[o][i] - simulated[r][o][i], 2), 1.0};
  return all;
}

}  // namespace

std::vector<Squares> squares_left(const Case& data, const std::vector<physics::Outputs>& simulated,
                                  const Weighing& on) {
  return squares_of(data, simulated, [&](auto r, auto o, auto i) { return on.present[r][o][i]; });
}

std::vector<double> squares_left(const Case& data, const physics::Model& model) {
  std::vector<double> sums;
  for (const auto& one : squares_of(data, simulate(data, model), [&](auto r, auto o, auto i) {
         return std::isfinite(data.recordings[r].measured[o][i]);
       }))
    sums.push_back(one.sum);
  return sums;
}

double least_ratio(const Case& data, const Fit& a, const Fit& b) {
  double least = 1.0;
  const auto sums_a = squares_left(data, a.model), sums_b = squares_left(data, b.model);
  for (std::size_t o = 0; o < sums_b.size(); ++o)
    if (sums_b[o] > 0.0) least = std::min(least, std::sqrt(sums_a[o] / sums_b[o]));
  return least;
}

Fit fit_near(const Case& data, const Weighing& filters, const Fit& near, Effort effort, double leads_away) {
  auto followed = fit(data, filters, near.model, data.model, effort, &near);
  return least_ratio(data, near, followed) < leads_away
             ? fit(data, filters, near.model, data.model, Effort::evaluate(), &near)
             : std::move(followed);
}

double excursion_of(const Fit& fit) {
  double most = 0.0;
  for (const auto& f : fit.free) {
    if (f.where == Freedom::Where::curve || f.sigma <= 0.0) continue;
    if (f.where == Freedom::Where::parameter && is_start(fit.model.parameters[f.index])) continue;
    most = std::max(most, std::abs(get(fit.model, f) - f.center) / f.sigma);
  }
  return most;
}

}  // namespace invar::diagnosis
