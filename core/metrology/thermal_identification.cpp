#include "core/metrology/thermal_identification.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <utility>

#include "core/base/contract.hpp"
#include "core/numerics/gaussian_prior.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

/// A term that is wanted: its factor and, for a zone's, which zone.
struct Wanted {
  Wanted(ThermalFactor f, std::size_t z = 0) : factor{f}, zone{z} {}  // NOLINT: a factor alone is meant
  ThermalFactor factor;
  std::size_t zone;
};
using Factors = std::vector<Wanted>;
using numerics::NormalEquations;
using numerics::Posterior;

// Hyperparameters by name, all logarithms: "noise", "length" of the geometry, "thermal_length" of all other
// functions of x, "temperature_length", "rate_length", and a size for every factor.
using Hyper = std::map<std::string, double>;

/// Cholesky factor of a Matern covariance over `count` uniform points, plus a constant and a slope of
/// variance `free` times as large (what a function may do without being rough).
Eigen::MatrixXd covariance_factor(Eigen::Index count, double step, double length, double free) {
  Eigen::MatrixXd k(count, count);
  const double middle = 0.5 * static_cast<double>(count - 1);
  const double half = std::max(1.0, middle) * step;
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double u = (static_cast<double>(i) - middle) * step / half;
      const double v = (static_cast<double>(j) - middle) * step / half;
      k(i, j) = k(j, i) =
          numerics::matern52(static_cast<double>(i - j) * step, length) + free * (1.0 + u * v);
    }
  k.diagonal().array() += 1e-9 * (1.0 + free);
  return k.llt().matrixL();
}

/// The readings, the basis of every term over them, and the fit of any subset of terms.
class Identifier {
 public:
  Identifier(const ThermalReadings& readings, double lag) : readings_{readings}, lag_{lag} {
    const Eigen::VectorXd temperature =
        lag > 0.0 ? lagged_temperature(*readings.time, readings.temperature, lag) : readings.temperature;
    shape_.x = {readings.x.minCoeff(), readings.x.maxCoeff()};
    shape_.temperature = {temperature.minCoeff(), temperature.maxCoeff()};
    if (readings.heating_rate)
      shape_.heating_rate = {readings.heating_rate->minCoeff(), readings.heating_rate->maxCoeff()};
    else
      shape_.heating_rate = {0.0, 0.0};
    for (const auto& zone : readings.zones)
      shape_.zones.push_back({zone.name, {zone.temperature.minCoeff(), zone.temperature.maxCoeff()}, 0.0});
    shape_.lag = lag;
    temperature_ = temperature;
    scale_ = std::max(robust_size(readings.error), 1e-12);
    const std::set<double> distinct{readings.x.begin(), readings.x.end()};
    positions_ = static_cast<int>(std::clamp<std::size_t>(distinct.size(), 2, 41));
    weights_ = Eigen::VectorXd::Ones(readings.x.size());
  }

  void use(const Factors& factors) {
    terms_.clear();
    Eigen::Index columns = 0;
    for (const auto& [factor, zone] : factors) {
      const int intervals = factor == ThermalFactor::geometry ? positions_ - 1
                            : factor == ThermalFactor::temperature || factor == ThermalFactor::zone
                                ? std::min(positions_ - 1, 20)
                                : std::min(positions_ - 1, 10);
      ThermalTerm term;
      term.factor = factor;
      term.zone = zone;
      term.spacing = shape_.x.width() / intervals;
      term.first = shape_.x.lower - term.spacing;  // one centre beyond either end
      term.weights = Eigen::MatrixXd::Zero(intervals + 3, factor_count(factor));
      columns += term.weights.size();
      terms_.push_back(std::move(term));
    }
    rows_.resize(readings_.x.size(), columns);
    for (Eigen::Index i = 0; i < rows_.rows(); ++i) rows_.row(i) = basis(i).transpose();
    sums_ = NormalEquations::of(rows_, readings_.error, weights_);
  }

  void reweigh(const Eigen::VectorXd& weights) {
    weights_ = weights;
    sums_ = NormalEquations::of(rows_, readings_.error, weights_);
  }

  [[nodiscard]] Posterior fit(const Hyper& hyper, bool with_covariance) const {
    return posterior(sums_, prior(hyper), std::exp(hyper.at("noise")), with_covariance);
  }

  /// Fills in what is missing of `hyper`, then maximises evidence and hyperprior over all that matter.
  void search(Hyper& hyper, double step) const {
    const auto defaults = typical();
    std::vector<std::string> names;
    for (const std::string& name : needed()) {
      hyper.try_emplace(name, defaults.at(name));
      names.push_back(name);
    }
    Eigen::VectorXd start(static_cast<Eigen::Index>(names.size()));
    for (Eigen::Index k = 0; k < start.size(); ++k) start(k) = hyper.at(names[static_cast<std::size_t>(k)]);
    const auto objective = [&](const Eigen::VectorXd& p) {
      Hyper trial = hyper;
      double log_prior = 0.0;
      for (Eigen::Index k = 0; k < p.size(); ++k) {
        const std::string& name = names[static_cast<std::size_t>(k)];
        trial[name] = p(k);
        const double spread = name.ends_with("length") ? 1.0 : 3.0;
        log_prior -= 0.5 * std::pow((p(k) - defaults.at(name)) / spread, 2);
      }
      return fit(trial, false).log_evidence + log_prior;
    };
    const Eigen::VectorXd best = numerics::maximise(objective, start, step, 0.2);
    for (Eigen::Index k = 0; k < best.size(); ++k) hyper[names[static_cast<std::size_t>(k)]] = best(k);
  }

  /// Weights of one for readings within 4.5 standard deviations, zero for the others.
  [[nodiscard]] Eigen::VectorXd judged(const Eigen::VectorXd& residual) const {
    const double sigma = robust_size(residual);
    return (residual.array().abs() <= 4.5 * std::max(sigma, 1e-15)).cast<double>();
  }

  /// A first robust fit with typical hyperparameters and Cauchy weights, for readings with gross outliers.
  void reject_outliers() {
    Hyper hyper = typical();
    Eigen::VectorXd residual = readings_.error;
    for (int round = 0; round < 8; ++round) {
      hyper["noise"] = std::log(std::max(0.3 * robust_size(residual), 1e-12));
      const Posterior p = fit(hyper, false);
      residual = readings_.error - rows_ * p.mean;
      const double sigma = std::max(robust_size(residual), 1e-15);
      reweigh((1.0 + (residual.array() / (2.0 * sigma)).square()).inverse());
    }
    reweigh(judged(residual));
  }

  [[nodiscard]] Hyper typical() const {
    const double span = std::max(shape_.x.width(), 1e-12);
    Hyper hyper{{"noise", std::log(0.1 * scale_)},
                {"length", std::log(0.2 * span)},
                {"thermal_length", std::log(0.5 * span)},
                {"temperature_length", std::log(2.0)},
                {"rate_length", std::log(2.0)}};
    for (int f = 0; f <= static_cast<int>(ThermalFactor::direction); ++f) {
      const auto factor = static_cast<ThermalFactor>(f);
      hyper["size_" + name_of(factor)] = std::log(
          (factor == ThermalFactor::geometry || factor == ThermalFactor::temperature ? 0.5 : 0.05) * scale_);
    }
    return hyper;
  }

  /// RMS of the residuals each reading would have if it had been left out.
  [[nodiscard]] double left_out_rms(const Posterior& p, double noise) const {
    double squares = 0.0;
    double count = 0.0;
    const Eigen::MatrixXd half = rows_ * p.covariance;
    for (Eigen::Index i = 0; i < rows_.rows(); ++i) {
      if (weights_(i) <= 0.0) continue;
      const double lever = weights_(i) * half.row(i).dot(rows_.row(i)) / (noise * noise);
      const double residual = readings_.error(i) - rows_.row(i).dot(p.mean);
      squares += std::pow(residual / std::max(1.0 - lever, 1e-6), 2);
      count += 1.0;
    }
    return std::sqrt(squares / std::max(count, 1.0));
  }

  /// The model with its weights and its table of standard deviations.
  [[nodiscard]] ThermalError model(const Posterior& p, double noise) const {
    ThermalError result = shape_;
    result.terms = terms_;
    result.noise = noise;
    Eigen::Index at = 0;
    for (ThermalTerm& term : result.terms) {
      term.weights =
          p.mean.segment(at, term.weights.size()).reshaped(term.weights.rows(), term.weights.cols());
      at += term.weights.size();
    }
    const bool rate = result.heating_rate.width() > 0.0;
    const bool temperature = result.temperature.width() > 0.0;
    const std::array<numerics::GridAxis, 3> axes{
        numerics::GridAxis{result.x, static_cast<std::size_t>(positions_)},
        numerics::GridAxis{result.temperature, temperature ? 9U : 1U},
        numerics::GridAxis{result.heating_rate, rate ? 5U : 1U}};
    result.sigma_table = numerics::LookupTable<3>{
        axes, [&](const std::array<double, 3>& node) {
          double most = 0.0;
          for (const ThermalState& state : with_zones({node[0], node[1], node[2], {}})) {
            const Eigen::VectorXd columns = basis(state, 0.0);
            most = std::max(most, columns.dot(p.covariance * columns));
          }
          return std::sqrt(most);
        }};
    return result;
  }

  [[nodiscard]] Eigen::VectorXd predicted(const Posterior& p) const { return rows_ * p.mean; }
  [[nodiscard]] const Eigen::VectorXd& weights() const { return weights_; }
  [[nodiscard]] const ThermalError& shape() const { return shape_; }
  [[nodiscard]] double scale() const { return scale_; }

 private:
  static double robust_size(const Eigen::VectorXd& values) {
    const std::vector<double> list{values.begin(), values.end()};
    return numerics::robust_deviation(list, numerics::median(list));
  }

  [[nodiscard]] Eigen::VectorXd basis(const ThermalState& at, double direction) const {
    Eigen::Index total = 0;
    for (const ThermalTerm& term : terms_) total += term.weights.size();
    Eigen::VectorXd columns(total);
    Eigen::Index begin = 0;
    for (const ThermalTerm& term : terms_) {
      columns.segment(begin, term.weights.size()) = thermal_basis(term, shape_, at, direction);
      begin += term.weights.size();
    }
    return columns;
  }

  [[nodiscard]] Eigen::VectorXd basis(Eigen::Index i) const {
    ThermalState at{
        readings_.x(i), temperature_(i), readings_.heating_rate ? (*readings_.heating_rate)(i) : 0.0, {}};
    for (std::size_t z = 0; z < readings_.zones.size(); ++z) at.zones[z] = readings_.zones[z].temperature(i);
    return basis(at, readings_.direction ? (*readings_.direction)(i) : 0.0);
  }

  /// The state with all zones cold and with all warm.
  [[nodiscard]] std::array<ThermalState, 2> with_zones(const ThermalState& at) const {
    std::array<ThermalState, 2> both{at, at};
    for (std::size_t z = 0; z < shape_.zones.size(); ++z) {
      both[0].zones[z] = shape_.zones[z].range.lower;
      both[1].zones[z] = shape_.zones[z].range.upper;
    }
    return both;
  }

  [[nodiscard]] std::vector<std::string> needed() const {
    std::vector<std::string> names{"noise"};
    bool thermal = false;
    for (const ThermalTerm& term : terms_) {
      names.push_back("size_" + name_of(term.factor));
      if (term.factor == ThermalFactor::geometry) names.emplace_back("length");
      if (term.factor == ThermalFactor::temperature_curve) names.emplace_back("temperature_length");
      if (term.factor == ThermalFactor::rate_curve) names.emplace_back("rate_length");
      thermal = thermal || term.factor != ThermalFactor::geometry;
    }
    if (thermal) names.emplace_back("thermal_length");
    return names;
  }

  [[nodiscard]] std::vector<Eigen::MatrixXd> prior(const Hyper& hyper) const {
    std::vector<Eigen::MatrixXd> factors;
    for (const ThermalTerm& term : terms_) {
      const double size = std::exp(hyper.at("size_" + name_of(term.factor)));
      const bool geometry = term.factor == ThermalFactor::geometry;
      // Offset and slope of the geometry and of the linear expansion are free; elsewhere they are like the
      // rest.
      const bool free =
          geometry || term.factor == ThermalFactor::temperature || term.factor == ThermalFactor::zone;
      const Eigen::MatrixXd over_x = covariance_factor(
          term.weights.rows(), term.spacing, std::exp(hyper.at(geometry ? "length" : "thermal_length")),
          free ? std::pow(10.0 * scale_ / size, 2) : 1.0);
      if (term.weights.cols() == 1) {
        factors.push_back(size * over_x);
        continue;
      }
      const bool rate = term.factor == ThermalFactor::rate_curve;
      const Eigen::MatrixXd over_factor = covariance_factor(
          term.weights.cols(), 0.6, std::exp(hyper.at(rate ? "rate_length" : "temperature_length")), 0.0);
      const Eigen::Index n = term.weights.rows();
      Eigen::MatrixXd both = Eigen::MatrixXd::Zero(term.weights.size(), term.weights.size());
      for (Eigen::Index i = 0; i < term.weights.cols(); ++i)
        for (Eigen::Index j = 0; j <= i; ++j)
          both.block(i * n, j * n, n, n) = size * over_factor(i, j) * over_x;
      factors.push_back(std::move(both));
    }
    return factors;
  }

  const ThermalReadings& readings_;
  double lag_;
  ThermalError shape_;
  Eigen::VectorXd temperature_;
  double scale_ = 1.0;
  int positions_ = 2;
  Eigen::VectorXd weights_;
  std::vector<ThermalTerm> terms_;
  Eigen::MatrixXd rows_;
  NormalEquations sums_;
};

std::string text(const char* format, double a, double b = 0.0) {
  std::array<char, 200> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, a, b);
  return buffer.data();
}

/// A candidate in full: its terms, hyperparameters, posterior.
struct Tried {
  Factors factors;
  Hyper hyper;
  Posterior posterior;
  ThermalCandidate candidate;
};

Tried attempt(Identifier& identifier, const std::string& name, const Factors& factors, const Hyper& start,
              double step) {
  Tried tried{factors, start, {}, {}};
  identifier.use(factors);
  identifier.search(tried.hyper, step);
  tried.posterior = identifier.fit(tried.hyper, true);
  tried.candidate.name = name;
  tried.candidate.log_evidence = tried.posterior.log_evidence;
  tried.candidate.left_out_rms = identifier.left_out_rms(tried.posterior, std::exp(tried.hyper.at("noise")));
  return tried;
}

constexpr double enough = 3.0;  // log evidence: odds of twenty to one

/// The slopes by which a held value may be wrong beyond each end: RMS over x of the model's at the edges, and
/// at least what expansion of steel to aluminium would do where the model says nothing.
void set_slopes(ThermalError& model, bool temperature_varies) {
  double by_x = 0.0;
  double by_t = 0.0;
  double by_r = 0.0;
  constexpr int steps = 20;
  const double dx = std::max(model.x.width() * 1e-3, 1e-9);
  const double dt = std::max(model.temperature.width() * 0.02, 1e-6);
  const double dr = std::max(model.heating_rate.width() * 0.02, 1e-12);
  const Range& temperature = model.temperature;
  const Range& rate = model.heating_rate;
  const double middle = 0.5 * (temperature.lower + temperature.upper);
  for (int k = 0; k <= steps; ++k) {
    const double x = model.x.lower + dx + (model.x.width() - 2.0 * dx) * k / steps;
    by_x +=
        std::pow((model.value({x + dx, middle, 0.0}) - model.value({x - dx, middle, 0.0})) / (2.0 * dx), 2);
    for (const auto& [end, inward] : {std::pair{temperature.lower, dt}, std::pair{temperature.upper, -dt}})
      by_t += 0.5 * std::pow((model.value({x, end + inward, 0.0}) - model.value({x, end, 0.0})) / dt, 2);
    for (const auto& [end, inward] : {std::pair{rate.lower, dr}, std::pair{rate.upper, -dr}})
      by_r +=
          0.5 * std::pow((model.value({x, middle, end + inward}) - model.value({x, middle, end})) / dr, 2);
  }
  model.slope_x = std::sqrt(by_x / (steps + 1));
  model.slope_temperature = std::sqrt(by_t / (steps + 1));
  model.slope_rate = std::sqrt(by_r / (steps + 1));
  if (!temperature_varies) model.slope_temperature = 20e-6 * std::max(model.x.width(), 0.1);  // 20 ppm/K
}

/// Zones that no term asks for are no inputs of the model; those that stay get the slope of their term over x.
void keep_zones_in_use(ThermalError& model) {
  std::vector<ThermalZone> used;
  for (ThermalTerm& term : model.terms) {
    if (term.factor != ThermalFactor::zone) continue;
    ThermalZone zone = model.zones[term.zone];
    term.zone = used.size();
    zone.slope =
        2.0 * term.weights.norm() / std::sqrt(static_cast<double>(term.weights.size())) / zone.range.width();
    used.push_back(std::move(zone));
  }
  model.zones = std::move(used);
}

/// Heating against cooling: what the model leaves on either branch.
std::optional<std::string> compare_branches(const ThermalReadings& readings, const Eigen::VectorXd& residual,
                                            const Eigen::VectorXd& kept) {
  if (!readings.heating_rate) return std::nullopt;
  double sum[2] = {0.0, 0.0};
  double count[2] = {0.0, 0.0};
  const double threshold = 0.05 * readings.heating_rate->cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    const double rate = (*readings.heating_rate)(i);
    if (kept(i) <= 0.0 || std::abs(rate) <= threshold) continue;
    sum[rate > 0.0] += residual(i);
    count[rate > 0.0] += 1.0;
  }
  if (count[0] < 2.0 || count[1] < 2.0) return std::nullopt;
  return text(
      "heating and cooling differ by %.3f um on average after the fit (%.0f readings on both branches)",
      1e6 * (sum[1] / count[1] - sum[0] / count[0]), count[0] + count[1]);
}

}  // namespace

ThermalFit identify_thermal(const ThermalReadings& readings) {
  const Eigen::Index n = readings.x.size();
  INVAR_EXPECTS(n >= 4 && readings.temperature.size() == n && readings.error.size() == n, n);
  ThermalFit fit;
  Identifier identifier{readings, 0.0};
  const bool temperature_varies = identifier.shape().temperature.width() > 0.2;
  const bool rate_varies = identifier.shape().heating_rate.width() > 1e-7;
  const bool both_ways =
      readings.direction && readings.direction->minCoeff() < 0.0 && readings.direction->maxCoeff() > 0.0;

  Factors room{ThermalFactor::geometry};
  if (both_ways) room.push_back(ThermalFactor::direction);
  Factors surface = room;
  surface.push_back(ThermalFactor::temperature);
  surface.push_back(ThermalFactor::temperature_curve);
  const Factors& base = temperature_varies ? surface : room;

  identifier.use(base);
  identifier.reject_outliers();
  Tried best = attempt(identifier, temperature_varies ? "position and temperature" : "position", base,
                       identifier.typical(), 1.6);
  // With noise and lengths known, judge the outliers once more.
  identifier.reweigh(identifier.judged(readings.error - identifier.predicted(best.posterior)));
  best = attempt(identifier, best.candidate.name, base, best.hyper, 0.4);
  std::vector<Tried> all;
  if (temperature_varies) {
    Hyper start = best.hyper;
    start["noise"] = std::log(0.5 * identifier.scale());
    all.push_back(attempt(identifier, "position only (room temperature)", room, start, 0.8));
  }
  all.push_back(best);
  std::size_t chosen = all.size() - 1;

  const auto consider = [&](Tried tried) {
    const double gain = tried.candidate.log_evidence - all[chosen].candidate.log_evidence;
    const bool better = gain > enough;
    tried.candidate.verdict = better
                                  ? text("taken: log evidence rises by %.1f", gain)
                                  : text("not taken: log evidence changes by %.1f, 3 would be needed", gain);
    all.push_back(std::move(tried));
    if (better) chosen = all.size() - 1;
  };
  for (std::size_t z = 0; z < readings.zones.size(); ++z) {
    if (identifier.shape().zones[z].range.width() < 0.2) continue;
    Factors with_zone = all[chosen].factors;
    with_zone.emplace_back(ThermalFactor::zone, z);
    consider(attempt(identifier, "and temperature of " + readings.zones[z].name, with_zone, all[chosen].hyper,
                     0.8));
  }
  const Factors slow = all[chosen].factors;  // what a lag is tried with
  const Hyper slow_hyper = all[chosen].hyper;
  if (rate_varies) {
    Factors with_rate = all[chosen].factors;
    with_rate.push_back(ThermalFactor::rate);
    if (temperature_varies) with_rate.push_back(ThermalFactor::rate_temperature);
    consider(attempt(identifier, "and heating rate", with_rate, all[chosen].hyper, 0.8));
    Factors with_hysteresis = with_rate;
    with_hysteresis.push_back(ThermalFactor::rate_curve);
    with_hysteresis.push_back(ThermalFactor::hysteresis);
    consider(attempt(identifier, "and hysteresis", with_hysteresis, all.back().hyper, 0.8));
  }

  // A lagged temperature replaces the measured one; the time constant is profiled on a grid, then refined.
  double best_lag = 0.0;
  if (temperature_varies && readings.time) {
    const double duration = (*readings.time)(n - 1) - (*readings.time)(0);
    double best_evidence = -std::numeric_limits<double>::infinity();
    const auto evidence = [&](double lag) {
      Identifier lagged{readings, lag};
      if (lagged.shape().temperature.width() < 0.2) return -std::numeric_limits<double>::infinity();
      lagged.use(slow);
      lagged.reweigh(identifier.weights());
      double most = -std::numeric_limits<double>::infinity();
      for (const double less_noise : {0.0, 0.7, 1.4, 2.1}) {
        Hyper hyper = slow_hyper;
        hyper["noise"] -= less_noise;
        most = std::max(most, lagged.fit(hyper, false).log_evidence);
      }
      return most;
    };
    for (double lag = 20.0; lag < 0.5 * duration && lag < 2e4; lag *= 1.6)
      if (const double value = evidence(lag); value > best_evidence) {
        best_evidence = value;
        best_lag = lag;
      }
    for (double factor = 1.25; best_lag > 0.0 && factor > 1.02; factor = std::sqrt(factor))
      for (const double lag : {best_lag / factor, best_lag * factor})
        if (const double value = evidence(lag); value > best_evidence) {
          best_evidence = value;
          best_lag = lag;
        }
    if (best_lag > 0.0) {
      Identifier lagged{readings, best_lag};
      lagged.use(slow);
      lagged.reweigh(identifier.weights());
      Tried tried = attempt(lagged, "lagged temperature", slow, slow_hyper, 0.8);
      tried.candidate.lag = best_lag;
      consider(std::move(tried));
    }
  }

  Tried& final = all[chosen];
  Identifier last{readings, final.candidate.lag};
  last.use(final.factors);
  last.reweigh(identifier.weights());
  const double noise = std::exp(final.hyper.at("noise"));
  fit.model = last.model(final.posterior, noise);
  fit.predicted = last.predicted(final.posterior);
  fit.kept = last.judged(readings.error - fit.predicted).cwiseProduct(identifier.weights());
  set_slopes(fit.model, temperature_varies);
  keep_zones_in_use(fit.model);

  final.candidate.chosen = true;
  if (final.candidate.verdict.empty()) final.candidate.verdict = "taken";
  for (Tried& tried : all) {
    if (tried.candidate.verdict.empty())
      tried.candidate.verdict = text("not taken: log evidence is lower by %.1f",
                                     final.candidate.log_evidence - tried.candidate.log_evidence);
    fit.candidates.push_back(tried.candidate);
  }
  for (const ThermalTerm& term : fit.model.terms)
    if (term.factor == ThermalFactor::direction) fit.reversal = 2.0 * term.weights.mean() * 1.0;

  if (!temperature_varies) fit.unidentified.emplace_back("temperature dependence");
  if (readings.heating_rate && !rate_varies) fit.unidentified.emplace_back("heating rate dependence");
  if (!temperature_varies)
    fit.notes.push_back(text("the temperature varies by %.2f K only: its effect cannot be told",
                             identifier.shape().temperature.width()));
  if (auto branches = compare_branches(readings, readings.error - fit.predicted, fit.kept))
    fit.notes.push_back(*branches);
  return fit;
}

}  // namespace invar::metrology
