#include "core/diagnosis/estimate/fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/common_factor.hpp"
#include "core/diagnosis/estimate/own_rows.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Role;

namespace {

// What users believe has a heavy tail (Student's t, 3 degrees of freedom): one parameter that is far off is likelier
// than several that are each a little off.
constexpr double tail = 3.0;
double prior_cost(const Freedom& f, double value) {
  const double z = (value - f.center) / f.sigma;
  return f.where == Freedom::Where::curve ? 0.5 * z * z : 0.5 * (tail + 1.0) * std::log1p(z * z / tail);
}
/// The weight of a Gaussian prior that has the same slope here.
double prior_weight(const Freedom& f, double value) {
  const double z = (value - f.center) / f.sigma;
  return (f.where == Freedom::Where::curve ? 1.0 : (tail + 1.0) / (tail + z * z)) / (f.sigma * f.sigma);
}

/// A knot that no row visits lies between its neighbours: how far two of them may part, against the prior of one alone.
constexpr double beside = 0.1;
/// Calls f(k) for every two neighbours k and k + 1 of a curve.
template <class F>
void for_neighbours(const std::vector<Freedom>& free, F f) {
  for (std::size_t k = 0; k + 1 < free.size(); ++k)
    if (free[k].where == Freedom::Where::curve && free[k + 1].where == Freedom::Where::curve &&
        free[k].term == free[k + 1].term)
      f(k);
}

double neighbour_weight(const Freedom& f) { return 1.0 / std::pow(beside * f.sigma, 2); }

}  // namespace

Eigen::VectorXd slope_of_priors(const Fit& fit) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit.free.size()));
  for (Eigen::Index k = 0; k < slope.size(); ++k) {
    const auto& f = fit.free[static_cast<std::size_t>(k)];
    const double value = get(fit.model, f);
    if (f.sigma > 0.0) slope(k) = (value - f.center) * prior_weight(f, value);
  }
  for_neighbours(fit.free, [&](std::size_t at) {
    const auto k = static_cast<Eigen::Index>(at);
    const double pull =
        neighbour_weight(fit.free[at]) * (get(fit.model, fit.free[at + 1]) - get(fit.model, fit.free[at]));
    slope(k) -= pull, slope(k + 1) += pull;
  });
  return slope;
}

namespace {

bool same_term(const Model& a, const Model& b, std::size_t term) {
  if (term >= a.terms.size() || term >= b.terms.size()) return false;
  const auto &one = a.terms[term], &other = b.terms[term];
  return one.info == other.info && one.on == other.on && one.with == other.with &&
         one.curve.knots == other.curve.knots && one.curve.memory == other.curve.memory;
}

/// The sensitivities of `free`, as far as possible those of `near`.
Eigen::MatrixXd nearly(const Case& data, const Model& model, const std::vector<Freedom>& free,
                       const Fit* near) {
  std::vector<Freedom> missing;
  std::vector<Eigen::Index> from(free.size(), -1);
  for (std::size_t k = 0; k < free.size(); ++k) {
    const auto& f = free[k];
    if (near != nullptr && near->columns.cols() == static_cast<Eigen::Index>(near->free.size()))
      for (std::size_t q = 0; q < near->free.size(); ++q) {
        const auto& g = near->free[q];
        if (g.where != f.where || g.index != f.index) continue;
        if (f.where == Freedom::Where::parameter ||
            (g.term == f.term && same_term(near->model, model, f.term)))
          from[k] = static_cast<Eigen::Index>(q);
      }
    if (from[k] < 0) missing.push_back(f);
  }
  if (missing.size() == free.size()) return sensitivities(data, model, free);
  const Eigen::MatrixXd found = missing.empty() ? Eigen::MatrixXd{} : sensitivities(data, model, missing);
  Eigen::MatrixXd all(near->columns.rows(), static_cast<Eigen::Index>(free.size()));
  Eigen::Index next = 0;
  for (std::size_t k = 0; k < free.size(); ++k)
    all.col(static_cast<Eigen::Index>(k)) = from[k] >= 0 ? near->columns.col(from[k]) : found.col(next++);
  return all;
}

/// What a term in the user's own equations costs because few machines have it: a rate that goes with the third power of a
/// speed is rare where air and oil know the first and second; one that goes with another variable had many to choose from;
/// a dead zone in which its input never was is no more than an offset.
double rarity(const Case& data, const Model& model, const physics::Term& term) {
  if (model.plant != physics::Plant::equations) return 0.0;
  if (term.info->name == "dead_zone") {
    for (const auto& input : model.equations.inputs)
      if (const auto range = covered(data, input.signal); input.symbol == term.on && range)
        return range->lower >= term.values[0] || range->upper <= -term.values[0] ? 3.0 : 0.0;
    return 0.0;
  }
  // A law bends over its own state; what another one does mostly goes straight (a coupling).
  if (!term.with.empty() && !physics::is_felt_by_others_alone(term))
    return std::log(static_cast<double>(model.equations.states.size() + model.equations.inputs.size())) +
           (term.info->name == "quadratic" || term.info->name == "cubic" ? 3.0 : 0.0);
  const bool speed = std::any_of(model.equations.states.begin(), model.equations.states.end(),
                                 [&](const auto& state) { return state.derivative == term.on; });
  return term.info->name == "cubic" && speed ? 3.0 : 0.0;
}

/// The damped Newton step; a number that stands at a bound and would leave through it is held while the others move.
Eigen::VectorXd step_within(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, double damping,
                            const Fit& at) {
  const Eigen::Index n = gradient.size();
  Eigen::MatrixXd damped = hessian;
  for (Eigen::Index k = 0; k < n; ++k) damped(k, k) += damping * hessian(k, k) + 1e-300;
  Eigen::VectorXd downhill = -gradient;
  for (;;) {
    const Eigen::VectorXd step = damped.ldlt().solve(downhill);
    bool held = false;
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto& f = at.free[static_cast<std::size_t>(k)];
      const double value = get(at.model, f);
      if (!((step(k) < 0.0 && value <= f.bounds.lower) || (step(k) > 0.0 && value >= f.bounds.upper)))
        continue;
      damped.row(k).setZero();
      damped.col(k).setZero();
      damped(k, k) = 1.0;
      downhill(k) = 0.0;
      held = true;
    }
    if (!held) return step;
  }
}

}  // namespace

double price_of_current(double frequency) {
  for (const double hum : {50.0, 60.0, 100.0, 120.0, 150.0, 180.0, 300.0, 360.0})
    if (std::abs(frequency - hum) < 0.003 * hum) return -4.0;
  return 4.0;
}

namespace {

/// A limit that no row reaches does nothing, and from there no slope leads back: it is kept where some do.
void keep_reached(const Case& data, const Model& model, std::vector<Freedom>& free) {
  for (auto& f : free) {
    if (f.where != Freedom::Where::term || f.sigma > 0.0) continue;
    const auto& term = model.terms[f.term];
    if (term.info->name != "heater_saturation") continue;
    if (const double top = highest_power(data, term.on); top > 0.0) f.bounds.upper = (1.0 - 1e-4) * top;
  }
}

}  // namespace

Fit fit(const Case& data, const Weighing& weighing, const Model& start, const Model& believed, int iterations,
        const Fit* near) {
  Fit best;
  best.model = start;
  best.free = freedoms(start, believed);
  if (data.model.plant == physics::Plant::thermal) keep_reached(data, start, best.free);
  for (const auto& f : best.free)  // first order does not know that friction takes energy
    if (f.where == Freedom::Where::curve) set(best.model, f, f.bounds.clamp(get(best.model, f)));
  const auto n = static_cast<Eigen::Index>(best.free.size());
  const auto priors = [&](const Model& model) {
    double sum = 0.0;
    for (const auto& f : best.free)
      if (f.sigma > 0.0) sum += prior_cost(f, get(model, f));
    for_neighbours(best.free, [&](std::size_t k) {
      const double apart = get(model, best.free[k + 1]) - get(model, best.free[k]);
      sum += 0.5 * std::pow(apart / (beside * best.free[k].sigma), 2);
    });
    return sum;
  };
  Eigen::VectorXd raw = differences(data, simulate(data, best.model));
  best.residual = filtered(data, weighing, raw);
  best.data_cost = 0.5 * weighing.temper * best.residual.squaredNorm();
  best.cost = best.data_cost + priors(best.model);
  best.columns = nearly(data, best.model, best.free, near);
  bool fresh = near == nullptr, verified = fresh;
  // To simulate: always fresh sensitivities.
  constexpr Eigen::Index cheap_values = 60000, many = 40;
  const bool cheap = data.model.plant == physics::Plant::equations && n * raw.size() <= cheap_values;
  Eigen::MatrixXd j = whitened(data, weighing, best.columns);
  std::vector<bool> of_window(best.free.size());
  for (std::size_t k = 0; k < of_window.size(); ++k)
    of_window[k] = best.free[k].where == Freedom::Where::parameter &&
                   is_start(best.model.parameters[best.free[k].index]);
  OwnRows white_rows{j, of_window}, raw_rows{best.columns, of_window};
  const auto find_anew = [&] {
    best.columns = sensitivities(data, best.model, best.free);
    j = whitened(data, weighing, best.columns);
    white_rows = OwnRows{j, of_window}, raw_rows = OwnRows{best.columns, of_window};
  };
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  const auto derive = [&] {
    if (white_rows.any()) {  // the products are most of what windows cost
      hessian = weighing.temper * white_rows.normal(j);
    } else if (n > many) {  // half of it
      hessian.setZero(n, n);
      hessian.selfadjointView<Eigen::Lower>().rankUpdate(j.transpose(), weighing.temper);
      hessian = Eigen::MatrixXd{hessian.selfadjointView<Eigen::Lower>()};
    } else {
      hessian = weighing.temper * (j.transpose() * j);
    }
    gradient = weighing.temper * (white_rows.any() ? white_rows.times(j, best.residual)
                                                   : Eigen::VectorXd{j.transpose() * best.residual});
    gradient += slope_of_priors(best);
    for (Eigen::Index k = 0; k < n; ++k)
      if (const auto& f = best.free[static_cast<std::size_t>(k)]; f.sigma > 0.0)
        hessian(k, k) += prior_weight(f, get(best.model, f));
    for_neighbours(best.free, [&](std::size_t at) {
      const auto k = static_cast<Eigen::Index>(at);
      const double weight = neighbour_weight(best.free[at]);
      hessian(k, k) += weight, hessian(k + 1, k + 1) += weight;
      hessian(k, k + 1) -= weight, hessian(k + 1, k) -= weight;
    });
  };
  // Along the factor that the data leave open a damped step only creeps: it is taken at once.
  const auto take_factor = [&] {
    const double factor = take_common_factor(best.model, best.free, priors);
    if (factor == 1.0) return;
    const auto goes = with_common_factor(best.model, best.free);
    for (Eigen::Index k = 0; k < n; ++k)
      if (goes[static_cast<std::size_t>(k)]) j.col(k) /= factor, best.columns.col(k) /= factor;
    best.cost = best.data_cost + priors(best.model);
  };
  take_factor();
  derive();
  double damping = 1e-3;
  int failures = 0;
  for (int i = 0; i < iterations && n > 0; ++i) {
    const Eigen::VectorXd step = step_within(hessian, gradient, damping, best);
    if (!step.allFinite()) break;
    Model tried = best.model;
    Eigen::VectorXd taken(n), scale(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto& f = best.free[static_cast<std::size_t>(k)];
      double by = step(k);
      // A shape is trusted to be linear only so far.
      if (f.where == Freedom::Where::term && f.sigma <= 0.0)
        by = std::clamp(by, -20.0 * f.scale, 20.0 * f.scale);
      const double before = get(best.model, f);
      set(tried, f, f.bounds.clamp(before + by));
      taken(k) = get(tried, f) - before;
      scale(k) = f.scale;
    }
    const Eigen::VectorXd raw_tried = differences(data, simulate(data, tried));
    Eigen::VectorXd r = filtered(data, weighing, raw_tried);
    const double data_cost = 0.5 * weighing.temper * r.squaredNorm();
    const double cost = data_cost + priors(tried);
    if (cost < best.cost) {
      const Eigen::VectorXd by_scale = taken.cwiseQuotient(scale.cwiseProduct(scale));
      if (const double length = taken.dot(by_scale); length > 0.0 && !cheap) {
        // Broyden: the sensitivities now give the change that was seen.
        const Eigen::VectorXd error = r - best.residual - j * taken;
        Eigen::VectorXd change = raw_tried - raw - best.columns * taken;
        change = change.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; }).eval();
        if (white_rows.any()) {
          white_rows.update(j, error, taken, scale);
          raw_rows.update(best.columns, change, taken, scale);
        } else {
          j += error * by_scale.transpose() / length;
          best.columns += change * by_scale.transpose() / length;
        }
      }
      const double gained = best.cost - cost;
      best.model = std::move(tried);
      best.residual = std::move(r);
      raw = raw_tried;
      best.cost = cost;
      best.data_cost = data_cost;
      take_factor();
      damping = std::max(1e-9, 0.1 * damping);
      const bool settled = gained < 0.2;
      if (settled && (verified || iterations < 4)) break;
      if (settled || cheap) {  // with sensitivities from elsewhere: only fresh ones can say so
        find_anew();
        verified = true;
      }
      fresh = settled || cheap;
      derive();
    } else if (cost < best.cost + 0.05 && (fresh || iterations < 4)) {
      break;  // as good as it gets
    } else if (!fresh) {
      verified = true;
      find_anew();
      fresh = true;
      derive();
    } else {
      damping *= 30.0;
      if (++failures > 4) break;
    }
  }
  // Numbers that the data do not move keep their prior and cost nothing.
  double complexity = 0.0;
  const double observations = std::max(10.0, weighing.temper * static_cast<double>(best.residual.size()));
  for (const auto& f : best.free)
    if (!(f.sigma > 0.0) || f.where == Freedom::Where::curve) complexity += 0.5 * std::log(observations);
  // A pitch or a frequency was looked for in as many places as the recording resolves.
  for (std::size_t t = believed.terms.size(); t < best.model.terms.size(); ++t)
    for (const char* scanned : {"pitch", "frequency", "period"})
      if (best.model.terms[t].info->index_of(scanned) < physics::most_parameters &&
          best.model.terms[t].info->index_of("phase") < physics::most_parameters)
        complexity += 0.7 * std::log(observations);
  for (std::size_t t = believed.terms.size(); t < best.model.terms.size(); ++t)
    if (const auto& term = best.model.terms[t]; term.info->name == "additive_disturbance" &&
                                                !believed.records_applied &&
                                                term.values[term.info->index_of("squareness")] < 0.5)
      best.unlikely += price_of_current(term.values[term.info->index_of("frequency")]);
  for (std::size_t t = believed.terms.size(); t < best.model.terms.size(); ++t)
    best.unlikely += rarity(data, best.model, best.model.terms[t]);
  best.evidence = -best.cost - complexity - best.unlikely;
  Eigen::MatrixXd regular = hessian;
  for (Eigen::Index k = 0; k < n; ++k) regular(k, k) = regular(k, k) * (1.0 + 1e-9) + 1e-300;
  best.covariance = regular.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  best.sigma = best.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return best;
}

}  // namespace invar::diagnosis
