#include "core/diagnosis/estimate/priors.hpp"
#include "core/diagnosis/thresholds.hpp"

#include <cmath>

namespace invar::diagnosis {

using physics::Model;

namespace {

bool is_gaussian(const Freedom& f) { return f.where == Freedom::Where::curve; }

double cost_of(const Freedom& f, double value) {
  const double z = (value - f.center) / f.sigma;
  return is_gaussian(f)
             ? 0.5 * z * z
             : 0.5 * (thresholds::belief_freedom + 1.0) * std::log1p(z * z / thresholds::belief_freedom);
}

/// The weight of a Gaussian prior that has the same slope here.
double weight_of(const Freedom& f, double value) {
  const double z = (value - f.center) / f.sigma;
  return (is_gaussian(f) ? 1.0 : (thresholds::belief_freedom + 1.0) / (thresholds::belief_freedom + z * z)) /
         (f.sigma * f.sigma);
}

/// Calls f(k) for every two neighbouring knots k and k + 1 of a curve.
template <class F>
void for_neighbours(const std::vector<Freedom>& free, F f) {
  for (std::size_t k = 0; k + 1 < free.size(); ++k)
    if (is_gaussian(free[k]) && is_gaussian(free[k + 1]) && free[k].term == free[k + 1].term) f(k);
}

double neighbour_weight(const Freedom& f) { return 1.0 / std::pow(thresholds::neighbour_share * f.sigma, 2); }

}  // namespace

double cost_of_priors(const Model& model, const std::vector<Freedom>& free) {
  double sum = 0.0;
  for (const auto& f : free)
    if (f.sigma > 0.0) sum += cost_of(f, get(model, f));
  for_neighbours(free, [&](std::size_t k) {
    const double apart = get(model, free[k + 1]) - get(model, free[k]);
    sum += 0.5 * std::pow(apart / (thresholds::neighbour_share * free[k].sigma), 2);
  });
  return sum;
}

Eigen::VectorXd slope_of_priors(const Model& model, const std::vector<Freedom>& free) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(free.size()));
  for (Eigen::Index k = 0; k < slope.size(); ++k) {
    const auto& f = free[static_cast<std::size_t>(k)];
    const double value = get(model, f);
    if (f.sigma > 0.0) slope(k) = (value - f.center) * weight_of(f, value);
  }
  for_neighbours(free, [&](std::size_t at) {
    const auto k = static_cast<Eigen::Index>(at);
    const double pull = neighbour_weight(free[at]) * (get(model, free[at + 1]) - get(model, free[at]));
    slope(k) -= pull, slope(k + 1) += pull;
  });
  return slope;
}

void add_curvature_of_priors(const Model& model, const std::vector<Freedom>& free, Eigen::MatrixXd& hessian) {
  for (Eigen::Index k = 0; k < hessian.rows(); ++k)
    if (const auto& f = free[static_cast<std::size_t>(k)]; f.sigma > 0.0)
      hessian(k, k) += weight_of(f, get(model, f));
  for_neighbours(free, [&](std::size_t at) {
    const auto k = static_cast<Eigen::Index>(at);
    const double weight = neighbour_weight(free[at]);
    hessian(k, k) += weight, hessian(k + 1, k + 1) += weight;
    hessian(k, k + 1) -= weight, hessian(k + 1, k) -= weight;
  });
}

}  // namespace invar::diagnosis
