#include "core/diagnosis/evidence/first_order.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/diagnosis/estimate/priors.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"

namespace invar::diagnosis {

using physics::Role;
using physics::Term;

Nuisance nuisance(const Case& data, const Weighing& weighing, const Fit& base) {
  Nuisance n;
  n.columns = whitened(data, weighing,
                       base.columns.cols() == static_cast<Eigen::Index>(base.free.size())
                           ? base.columns
                           : sensitivities(data, base.model, base.free))
                  .dense();
  Eigen::MatrixXd h = weighing.temper * (n.columns.transpose() * n.columns);
  for (Eigen::Index k = 0; k < h.rows(); ++k) {
    const double sigma = base.free[static_cast<std::size_t>(k)].sigma;
    if (sigma > 0.0) h(k, k) += 1.0 / (sigma * sigma);
    h(k, k) += 1e-9 * h(k, k) + 1e-300;
  }
  n.hessian.compute(h);
  n.slope = Eigen::VectorXd::Zero(h.rows());
  // Elsewhere sensitivities are carried along from fit to fit and do not say so finely where the end is.
  if (data.model.plant != physics::Plant::equations) return n;
  n.slope =
      weighing.temper * (n.columns.transpose() * base.residual) + slope_of_priors(base.model, base.free);
  for (Eigen::Index k = 0; k < n.slope.size(); ++k) {  // what a bound holds has arrived
    const auto& f = base.free[static_cast<std::size_t>(k)];
    const double value = get(base.model, f);
    if ((n.slope(k) > 0.0 && value <= f.bounds.lower) || (n.slope(k) < 0.0 && value >= f.bounds.upper))
      n.slope(k) = 0.0;
  }
  // Farther off, it is not this slope that holds it there: the valley bends.
  constexpr double a_fraction = 1.0;
  if (!(0.5 * n.slope.dot(n.hessian.solve(n.slope)) < a_fraction)) n.slope.setZero();
  return n;
}

namespace {

/// The start among `starts` whose curve has every knot of that of `start` and more; none: `start` itself.
std::size_t finer_than(const std::vector<Start>& starts, std::size_t start) {
  const auto& own = starts[start].term;
  std::size_t finest = start;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const auto& other = starts[i].term;
    const auto& knots = other.curve.knots;
    if (other.info != own.info || other.on != own.on || other.with != own.with ||
        other.curve.over != own.curve.over || own.with.empty() || own.curve.knots.empty() ||
        own.curve.period > 0.0 || other.curve.period > 0.0 || starts[i].step != starts[start].step ||
        knots.size() <= starts[finest].term.curve.knots.size())
      continue;
    const double near = 1e-9 * (knots.back() - knots.front());
    const bool has_all = own.curve.knots.front() <= knots.front() + near &&
                         own.curve.knots.back() >= knots.back() - near &&
                         std::all_of(own.curve.knots.begin(), own.curve.knots.end(), [&](double at) {
                           return std::any_of(knots.begin(), knots.end(),
                                              [&](double knot) { return std::abs(knot - at) <= near; });
                         });
    if (has_all) finest = i;
  }
  return finest;
}

/// What each direction of a curve is of those of a finer one.
Eigen::MatrixXd shares_of(const Start& start, const Start& finer) {
  const auto& knots = finer.term.curve.knots;
  Eigen::MatrixXd shares{static_cast<Eigen::Index>(finer.directions.size()),
                         static_cast<Eigen::Index>(start.directions.size())};
  auto curve = start.term.curve;
  for (std::size_t d = 0; d < start.directions.size(); ++d) {
    curve.values.assign(curve.knots.size(), 0.0);
    curve.values[start.directions[d].knot] = 1.0;
    for (std::size_t f = 0; f < finer.directions.size(); ++f)
      shares(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(d)) =
          curve(knots[finer.directions[f].knot]);
  }
  return shares;
}

/// By how much a value of the curve is moved for its slope.
double step_of_curve(const Case& data, const Start& start) {
  if (start.step > 0.0) return start.step;
  if (data.model.plant == physics::Plant::sensor) return 1e-7;
  const auto site = start.term.info->site;
  if (site == "actuator" || site == "thermal" || site == "measurement") return 1e-3;
  if (data.model.plant == physics::Plant::thermal) return 0.1;
  return data.model.plant == physics::Plant::axis ? 0.05 : 1e-6;
}

/// The term of a start moved along one direction alone, and how far.
std::pair<Term, double> moved(const Case& data, const Start& start, const Start::Direction& direction) {
  Term term = start.term;
  if (!term.curve.knots.empty()) {
    const double by = step_of_curve(data, start);
    term.curve.values[direction.knot] = by;
    return {std::move(term), by};
  }
  if (direction.amplitude >= physics::no_parameter) return {std::move(term), 1.0};
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
    if (term.info->parameters[i].role == Role::amplitude && i != direction.amplitude) term.values[i] = 0.0;
    if (term.info->parameters[i].role == Role::phase && direction.quadrature)
      term.values[i] += 0.5 * std::numbers::pi;
  }
  const double by = term.values[direction.amplitude];
  return {std::move(term), by};
}

}  // namespace

std::vector<Eigen::MatrixXd> columns_of(const Case& data, const Fit& base, const Eigen::VectorXd& at,
                                        const std::vector<Start>& starts) {
  std::vector<physics::Model> models;
  struct Place {
    std::size_t start;
    Eigen::Index direction;
    double step;
  };
  std::vector<Place> places;  // of each model
  std::vector<std::size_t> source;
  for (std::size_t i = 0; i < starts.size(); ++i) source.push_back(finer_than(starts, i));
  std::vector<Eigen::MatrixXd> all(starts.size());
  for (std::size_t s = 0; s < starts.size(); ++s) {
    if (source[s] != s) continue;
    const auto& start = starts[s];
    all[s].resize(at.size(), static_cast<Eigen::Index>(start.directions.size()));
    for (const auto& direction : start.directions) {
      auto [term, by] = moved(data, start, direction);
      models.emplace_back(base.model).terms.push_back(std::move(term));
      places.push_back({s, &direction - start.directions.data(), by});
    }
  }
  for_differences_of(data, models, [&](std::size_t k, const Eigen::VectorXd& left) {
    const auto& [start, direction, step] = places[k];
    all[start].col(direction) =
        ((left - at) / step).unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  });
  for (std::size_t i = 0; i < starts.size(); ++i)
    if (source[i] != i) all[i] = all[source[i]] * shares_of(starts[i], starts[source[i]]);
  return all;
}

Eigen::VectorXd slope_along(const Weighing& weighing, const Fit& base, const Nuisance& n,
                            const Eigen::MatrixXd& columns, const Eigen::MatrixXd& shared) {
  return weighing.temper * (columns.transpose() * base.residual) -
         shared.transpose() * n.hessian.solve(n.slope);
}

std::size_t directions_of(const std::vector<Start>& starts) {
  std::size_t sum = 0;
  for (const auto& start : starts) sum += start.directions.size();
  return sum;
}

}  // namespace invar::diagnosis
