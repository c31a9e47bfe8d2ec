#include "core/diagnosis/estimate/fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/common_factor.hpp"
#include "core/diagnosis/estimate/priors.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Role;

namespace {

bool same_term(const Model& a, const Model& b, std::size_t term) {
  if (term >= a.terms.size() || term >= b.terms.size()) return false;
  const auto &one = a.terms[term], &other = b.terms[term];
  return one.info == other.info && one.on == other.on && one.with == other.with &&
         one.curve.knots == other.curve.knots && one.curve.memory == other.curve.memory;
}

/// The sensitivities of `free`, as far as possible those of `near`.
Columns nearly(const Case& data, const Model& model, const std::vector<Freedom>& free, const Fit* near) {
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
  const Columns found = missing.empty() ? Columns{} : sensitivities(data, model, missing);
  std::vector<Eigen::Index> to_of_known(static_cast<std::size_t>(near->columns.cols()), -1), to_of_found;
  for (std::size_t k = 0; k < free.size(); ++k)
    if (from[k] >= 0)
      to_of_known[static_cast<std::size_t>(from[k])] = static_cast<Eigen::Index>(k);
    else
      to_of_found.push_back(static_cast<Eigen::Index>(k));
  return joined(static_cast<Eigen::Index>(free.size()), {{near->columns, to_of_known}, {found, to_of_found}});
}

/// What a term in the user's own equations costs because few machines have it: a rate that goes with the third power of a
/// speed is rare where air and oil know the first and second; one that goes with another variable had many to choose from;
/// a dead zone in which its input never was is no more than an offset.
double rarity(const Case& data, const Model& model, const physics::Term& term) {
  if (model.plant != physics::Plant::equations) return 0.0;
  if (term.info->cut == physics::Cut::around_zero) {
    for (const auto& input : model.equations.inputs)
      if (const auto range = covered(data, input.signal); input.symbol == term.on && range)
        return range->lower >= term.values[0] || range->upper <= -term.values[0] ? thresholds::rare_law : 0.0;
    return 0.0;
  }
  // A law bends over its own state; what another one does mostly goes straight (a coupling).
  if (!term.with.empty() && !physics::is_felt_by_others_alone(term))
    return std::log(static_cast<double>(model.equations.states.size() + model.equations.inputs.size())) +
           (term.info->power > 1 ? thresholds::rare_law : 0.0);
  const bool speed = std::any_of(model.equations.states.begin(), model.equations.states.end(),
                                 [&](const auto& state) { return state.derivative == term.on; });
  return term.info->power == 3 && speed ? thresholds::rare_law : 0.0;
}

/// The damped Newton step; a number that stands at a bound and would leave through it is held while the others move.
Eigen::VectorXd step_within(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, double damping,
                            const Fit& at) {
  const Eigen::Index n = gradient.size();
  Eigen::MatrixXd damped = hessian;
  for (Eigen::Index k = 0; k < n; ++k) damped(k, k) += damping * hessian(k, k) + 1e-300;
  Eigen::VectorXd downhill = -gradient;
  for (;;) {
    const Eigen::VectorXd step = numerics::solve_symmetric(damped, downhill);
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
    if (std::abs(frequency - hum) < thresholds::at_the_mains * hum) return -thresholds::current_or_force;
  return thresholds::current_or_force;
}

namespace {

/// A limit that no row reaches does nothing, and from there no slope leads back: it is kept where some do.
void keep_reached(const Case& data, const Model& model, std::vector<Freedom>& free) {
  for (auto& f : free) {
    if (f.where != Freedom::Where::term || f.sigma > 0.0) continue;
    const auto& term = model.terms[f.term];
    const auto* kind = physics::thermal_kind(*term.info);
    if (kind == nullptr || kind->heater == nullptr) continue;
    if (const double top = highest_power(data, term.on); top > 0.0) f.bounds.upper = (1.0 - 1e-4) * top;
  }
}

/// The free numbers of `start` and their priors, with the numbers put within their bounds.
Fit begin_at(const Case& data, const Model& start, const Model& believed) {
  Fit at;
  at.model = start;
  at.free = freedoms(start, believed);
  if (data.model.plant == physics::Plant::thermal) keep_reached(data, start, at.free);
  for (const auto& f : at.free)  // first order does not know that friction takes energy
    if (f.where == Freedom::Where::curve) set(at.model, f, f.bounds.clamp(get(at.model, f)));
  return at;
}

/// A point that a step leads to.
struct Trial {
  Model model;
  Eigen::VectorXd taken, scale;   // the step within the bounds, and the typical change of each number
  Eigen::VectorXd raw, residual;  // measured - simulated as it stands, and whitened
  double data_cost = 0.0, cost = 0.0;
};

/// Derivatives of measured - simulated by each free number, as they stand and whitened.
class Jacobian {
 public:
  Jacobian(const Case& data, const Weighing& weighing, Columns columns) : data_{data}, weighing_{weighing} {
    put(std::move(columns));
  }

  void find_anew(const Fit& at) { put(sensitivities(data_, at.model, at.free)); }
  [[nodiscard]] Columns take_columns() { return std::move(columns_); }

  /// The tempered J^T J.
  [[nodiscard]] Eigen::MatrixXd normal() const { return weighing_.temper * white_.normal(); }
  /// The tempered J^T r.
  [[nodiscard]] Eigen::VectorXd times(const Eigen::VectorXd& residual) const {
    return weighing_.temper * white_.transpose_times(residual);
  }

  void divide(Eigen::Index column, double factor) {
    white_.divide(column, factor), columns_.divide(column, factor);
  }

  /// Broyden's rule: afterwards the derivatives give the change that was seen from the point with these residuals.
  void update(const Trial& trial, const Eigen::VectorXd& raw, const Eigen::VectorXd& residual) {
    const auto &taken = trial.taken, &scale = trial.scale;
    white_.update(trial.residual - residual - white_.times(taken), taken, scale);
    const Eigen::VectorXd change = trial.raw - raw - columns_.times(taken);
    columns_.update(change.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; }), taken, scale);
  }

 private:
  void put(Columns columns) {
    columns_ = std::move(columns);
    white_ = whitened(data_, weighing_, columns_);
  }

  const Case& data_;
  const Weighing& weighing_;
  Columns columns_, white_;
};

/// Maximum a posteriori estimate by Levenberg-Marquardt, with Broyden's updates of the Jacobian between fresh ones.
class Minimizer {
 public:
  Minimizer(const Case& data, const Weighing& weighing, Fit start, Effort effort, const Fit* near)
      : data_{data},
        weighing_{weighing},
        effort_{effort},
        at_{std::move(start)},
        jacobian_{data, weighing, nearly(data, at_.model, at_.free, near)},
        is_fresh_{near == nullptr},
        is_verified_{is_fresh_} {
    raw_ = differences(data_, simulate(data_, at_.model));
    at_.residual = filtered(data_, weighing_, raw_);
    at_.data_cost = 0.5 * weighing_.temper * at_.residual.squaredNorm();
    at_.cost = at_.data_cost + cost_of_priors(at_.model, at_.free);
    constexpr Eigen::Index cheap_values = 60000;
    is_cheap_ = data.model.plant == physics::Plant::equations && count() * raw_.size() <= cheap_values;
  }

  Fit minimize() {
    take_factor();
    find_slopes();
    for (int i = 0; i < effort_.steps && count() > 0; ++i)
      if (!step()) break;
    at_.columns = jacobian_.take_columns();
    find_covariance();
    return std::move(at_);
  }

 private:
  [[nodiscard]] Eigen::Index count() const { return static_cast<Eigen::Index>(at_.free.size()); }

  /// False where no further step is worth its cost.
  bool step() {
    constexpr double as_good = 0.05;  // in cost: what a last step may lose and still be the end
    constexpr int most_failures = 4;
    const Eigen::VectorXd step = step_within(hessian_, gradient_, damping_, at_);
    if (!step.allFinite()) return false;
    Trial trial = try_out(step);
    if (trial.cost < at_.cost) return go_to(std::move(trial));
    if (trial.cost < at_.cost + as_good && (is_fresh_ || effort_.only_polishes)) return false;
    if (!is_fresh_) {  // carried derivatives may be what misled the step
      find_jacobian();
      find_slopes();
      return true;
    }
    damping_ *= 30.0;
    return ++failures_ <= most_failures;
  }

  [[nodiscard]] Trial try_out(const Eigen::VectorXd& step) const {
    constexpr double trusted = 20.0;  // scales: a shape is trusted to be linear only so far
    Trial trial;
    trial.model = at_.model;
    trial.taken.resize(count()), trial.scale.resize(count());
    for (Eigen::Index k = 0; k < count(); ++k) {
      const auto& f = at_.free[static_cast<std::size_t>(k)];
      double by = step(k);
      if (f.where == Freedom::Where::term && f.sigma <= 0.0)
        by = std::clamp(by, -trusted * f.scale, trusted * f.scale);
      const double before = get(at_.model, f);
      set(trial.model, f, f.bounds.clamp(before + by));
      trial.taken(k) = get(trial.model, f) - before;
      trial.scale(k) = f.scale;
    }
    trial.raw = differences(data_, simulate(data_, trial.model));
    trial.residual = filtered(data_, weighing_, trial.raw);
    trial.data_cost = 0.5 * weighing_.temper * trial.residual.squaredNorm();
    trial.cost = trial.data_cost + cost_of_priors(trial.model, at_.free);
    return trial;
  }

  /// False where the gain was so small that the fit has arrived.
  bool go_to(Trial trial) {
    constexpr double little = 0.2;  // in cost
    if (!is_cheap_) jacobian_.update(trial, raw_, at_.residual);
    const bool is_settled = at_.cost - trial.cost < little;
    at_.model = std::move(trial.model);
    at_.residual = std::move(trial.residual);
    raw_ = std::move(trial.raw);
    at_.cost = trial.cost;
    at_.data_cost = trial.data_cost;
    take_factor();
    damping_ = std::max(1e-9, 0.1 * damping_);
    if (is_settled && (is_verified_ || effort_.only_polishes)) return false;
    if (is_settled || is_cheap_)  // carried derivatives cannot say that the fit has arrived
      find_jacobian();
    else
      is_fresh_ = false;
    find_slopes();
    return true;
  }

  void find_jacobian() {
    jacobian_.find_anew(at_);
    is_fresh_ = is_verified_ = true;
  }

  void find_slopes() {
    hessian_ = jacobian_.normal();
    add_curvature_of_priors(at_.model, at_.free, hessian_);
    gradient_ = jacobian_.times(at_.residual);
    gradient_ += slope_of_priors(at_.model, at_.free);
  }

  /// Along the factor that the data leave open a damped step only creeps: it is taken at once.
  void take_factor() {
    const auto priors = [&](const Model& model) { return cost_of_priors(model, at_.free); };
    const double factor = take_common_factor(at_.model, at_.free, priors);
    if (factor == 1.0) return;
    const auto goes = with_common_factor(at_.model, at_.free);
    for (Eigen::Index k = 0; k < count(); ++k)
      if (goes[static_cast<std::size_t>(k)]) jacobian_.divide(k, factor);
    at_.cost = at_.data_cost + priors(at_.model);
  }

  /// From the curvature of the last slopes; numbers that the data do not move keep their prior.
  void find_covariance() {
    Eigen::MatrixXd regular = hessian_;
    for (Eigen::Index k = 0; k < count(); ++k) regular(k, k) = regular(k, k) * (1.0 + 1e-9) + 1e-300;
    at_.covariance = numerics::solve_symmetric(regular, Eigen::MatrixXd::Identity(count(), count()));
    at_.sigma = at_.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  }

  const Case& data_;
  const Weighing& weighing_;
  const Effort effort_;
  Fit at_;
  Eigen::VectorXd raw_;
  Jacobian jacobian_;
  bool is_fresh_;          // is the Jacobian that of this very point?
  bool is_verified_;       // has a Jacobian of its own been found since the start?
  bool is_cheap_ = false;  // to simulate: the Jacobian is found anew at each point
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd gradient_;
  double damping_ = 1e-3;
  int failures_ = 0;
};

/// Half the logarithm of the observations a free number without prior (BIC); numbers with a prior cost nothing.
double complexity_of(const Weighing& weighing, const Model& believed, const Fit& fit) {
  double complexity = 0.0;
  const double observations = std::max(10.0, weighing.temper * static_cast<double>(fit.residual.size()));
  for (const auto& f : fit.free)
    if (!(f.sigma > 0.0) || f.where == Freedom::Where::curve) complexity += 0.5 * std::log(observations);
  // A pitch or a frequency was looked for in as many places as the recording resolves.
  for (std::size_t t = believed.terms.size(); t < fit.model.terms.size(); ++t)
    for (const char* scanned : {"pitch", "frequency", "period"})
      if (fit.model.terms[t].info->index_of(scanned) < physics::most_parameters &&
          fit.model.terms[t].info->index_of("phase") < physics::most_parameters)
        complexity += thresholds::look_elsewhere * std::log(observations);
  return complexity;
}

/// How rare the terms are that the user did not write.
double rarity_of_all(const Case& data, const Model& believed, const Model& model) {
  double unlikely = 0.0;
  for (std::size_t t = believed.terms.size(); t < model.terms.size(); ++t)
    if (const auto& term = model.terms[t]; term.info->is_wave_in_time() && term.info->site == "actuator" &&
                                           !believed.records_applied &&
                                           term.values[term.info->index_of("squareness")] < 0.5)
      unlikely += price_of_current(term.values[term.info->index_of("frequency")]);
  for (std::size_t t = believed.terms.size(); t < model.terms.size(); ++t)
    unlikely += rarity(data, model, model.terms[t]);
  return unlikely;
}

}  // namespace

Fit fit(const Case& data, const Weighing& weighing, const Model& start, const Model& believed, Effort effort,
        const Fit* near) {
  Minimizer minimizer{data, weighing, begin_at(data, start, believed), effort, near};
  Fit best = minimizer.minimize();
  best.unlikely = rarity_of_all(data, believed, best.model);
  best.evidence = -best.cost - complexity_of(weighing, believed, best) - best.unlikely;
  return best;
}

}  // namespace invar::diagnosis
