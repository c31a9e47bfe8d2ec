#include "core/metrology/thermal/thermal_identification.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/contract.hpp"
#include "core/metrology/thermal/thermal_regression.hpp"

namespace invar::metrology {

namespace {

using numerics::Posterior;

std::string text(const char* format, double a, double b = 0.0) {
  std::array<char, 200> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, a, b);
  return buffer.data();
}

/// A candidate in full: its terms, hyperparameters, posterior.
struct Tried {
  WantedTerms terms;
  ThermalHyper hyper;
  Posterior posterior;
  ThermalCandidate candidate;
};

Tried attempt(ThermalRegression& identifier, const std::string& name, const WantedTerms& terms,
              const ThermalHyper& start, double step) {
  Tried tried{terms, start, {}, {}};
  identifier.use(terms);
  identifier.search(tried.hyper, step);
  tried.posterior = identifier.fit(tried.hyper, numerics::Covariance::found);
  tried.candidate.name = name;
  tried.candidate.log_evidence = tried.posterior.log_evidence;
  tried.candidate.left_out_rms = identifier.left_out_rms(tried.posterior, std::exp(tried.hyper.at("noise")));
  tried.candidate.held_out_rms = identifier.held_out_rms(tried.hyper);
  return tried;
}

constexpr double enough = 3.0;  // log evidence: odds of twenty to one

/// Candidates from the simplest on; one that asks for more must earn it: in log evidence, and without being worse on passes
/// that were not fitted.
class Contest {
 public:
  void begin(Tried tried) {
    tried_.push_back(std::move(tried));
    chosen_ = tried_.size() - 1;
  }
  void consider(Tried tried) {
    const double gain = tried.candidate.log_evidence - best().candidate.log_evidence;
    const double held_out = best().candidate.held_out_rms;
    const bool worse = tried.candidate.held_out_rms > 1.02 * held_out;
    std::string& verdict = tried.candidate.verdict;
    if (gain <= enough)
      verdict = text("not taken: log evidence changes by %.1f, %.0f would be needed", gain, enough);
    else if (worse)
      verdict = text("not taken: worse on passes not fitted, %.4g um instead of %.4g um",
                     1e6 * tried.candidate.held_out_rms, 1e6 * held_out);
    else
      verdict = text("taken: log evidence changes by %.1f", gain) +
                text(", passes not fitted are met to %.4g um instead of %.4g um",
                     1e6 * tried.candidate.held_out_rms, 1e6 * held_out);
    const bool taken = gain > enough && !worse;
    tried_.push_back(std::move(tried));
    if (taken) chosen_ = tried_.size() - 1;
  }
  [[nodiscard]] const Tried& best() const { return tried_[chosen_]; }
  [[nodiscard]] std::vector<ThermalCandidate> verdicts() const {
    std::vector<ThermalCandidate> all;
    for (std::size_t i = 0; i < tried_.size(); ++i) {
      all.push_back(tried_[i].candidate);
      ThermalCandidate& one = all.back();
      one.chosen = i == chosen_;
      if (one.chosen && one.verdict.empty()) one.verdict = "taken";
      const double lower = best().candidate.log_evidence - one.log_evidence;
      if (one.verdict.empty())
        one.verdict = text("not taken: log evidence is lower by %.1f", lower);
      else if (!one.chosen && one.verdict.starts_with("taken"))
        one.verdict += text("; overtaken by log evidence higher by %.1f", lower);
    }
    return all;
  }

 private:
  std::vector<Tried> tried_;
  std::size_t chosen_ = 0;
};

/// The same terms over the lagged temperature of a body behind the sensor; its time constant is profiled on a grid, then
/// refined. Nothing where the readings are too short for any.
std::optional<Tried> with_lag(const ThermalReadings& readings, const Tried& quick,
                              const Eigen::VectorXd& weights) {
  const Eigen::VectorXd& time = *readings.time;
  const double duration = time(time.size() - 1) - time(0);
  constexpr double never = -std::numeric_limits<double>::infinity();
  const auto evidence = [&](double lag) {
    ThermalRegression lagged{readings, lag};
    if (lagged.shape().temperature.width() < 0.2) return never;
    lagged.use(quick.terms);
    lagged.reweigh(weights);
    double most = never;
    for (const double less_noise : {0.0, 0.7, 1.4, 2.1}) {
      ThermalHyper hyper = quick.hyper;
      hyper["noise"] -= less_noise;
      most = std::max(most, lagged.fit(hyper, numerics::Covariance::left_out).log_evidence);
    }
    return most;
  };
  double best_lag = 0.0;
  double most = never;
  for (double lag = 20.0; lag < 0.5 * duration && lag < 2e4; lag *= 1.6)
    if (const double value = evidence(lag); value > most) {
      most = value;
      best_lag = lag;
    }
  for (double factor = 1.25; best_lag > 0.0 && factor > 1.02; factor = std::sqrt(factor))
    for (const double lag : {best_lag / factor, best_lag * factor})
      if (const double value = evidence(lag); value > most) {
        most = value;
        best_lag = lag;
      }
  if (best_lag <= 0.0) return std::nullopt;
  ThermalRegression lagged{readings, best_lag};
  lagged.use(quick.terms);
  lagged.reweigh(weights);
  Tried tried = attempt(lagged, "lagged temperature", quick.terms, quick.hyper, 0.8);
  tried.candidate.lag = best_lag;
  return tried;
}

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

/// A term over x with its factor at one, at `count` places along the travel.
Eigen::VectorXd along_travel(const ThermalTerm& term, const ThermalError& model) {
  constexpr Eigen::Index count = 41;
  ThermalTerm flat = term;
  flat.factor = ThermalFactor::geometry;
  return Eigen::VectorXd::LinSpaced(count, model.x.lower, model.x.upper).unaryExpr([&](double x) {
    return thermal_basis(flat, model, {x, 0.0, 0.0, {}}).dot(flat.coefficients());
  });
}

double size_of(const ThermalTerm& term, const ThermalError& model) {
  const Eigen::VectorXd values = along_travel(term, model);
  return values.norm() / std::sqrt(static_cast<double>(values.size()));
}

/// Zones that no term asks for are no inputs of the model; those that stay get the slope of their term over x.
void keep_zones_in_use(ThermalError& model) {
  std::vector<ThermalZone> used;
  for (ThermalTerm& term : model.terms) {
    if (term.factor != ThermalFactor::zone) continue;
    ThermalZone zone = model.zones[term.zone];
    term.zone = used.size();
    zone.slope = 2.0 * size_of(term, model) / zone.range.width();
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
      "heating and cooling differ by %.1f nm on average after the fit (%.0f readings on both branches)",
      1e9 * (sum[1] / count[1] - sum[0] / count[0]), count[0] + count[1]);
}

}  // namespace

ThermalFit identify_thermal(const ThermalReadings& readings) {
  const Eigen::Index n = readings.x.size();
  INVAR_EXPECTS(n >= 4 && readings.temperature.size() == n && readings.error.size() == n, n);
  ThermalFit fit;
  ThermalRegression identifier{readings, 0.0};
  const bool temperature_varies = identifier.shape().temperature.width() > 0.2;
  const bool rate_varies = identifier.shape().heating_rate.width() > 1e-7;
  const bool both_ways =
      readings.direction && readings.direction->minCoeff() < 0.0 && readings.direction->maxCoeff() > 0.0;

  WantedTerms room{ThermalFactor::geometry};
  if (both_ways) room.push_back(ThermalFactor::direction);
  WantedTerms surface = room;
  surface.push_back(ThermalFactor::temperature);
  surface.push_back(ThermalFactor::temperature_curve);
  const WantedTerms& base = temperature_varies ? surface : room;

  identifier.use(base);
  identifier.reject_outliers();
  Tried best = attempt(identifier, temperature_varies ? "position and temperature" : "position", base,
                       identifier.typical(), 1.6);
  // With noise and lengths known, judge the outliers once more.
  identifier.reweigh(identifier.judged(readings.error - identifier.predicted(best.posterior)).weights);
  best = attempt(identifier, best.candidate.name, base, best.hyper, 0.4);
  Contest contest;
  if (temperature_varies) {
    ThermalHyper start = best.hyper;
    start["noise"] = std::log(0.5 * identifier.scale());
    contest.begin(attempt(identifier, "position only (room temperature)", room, start, 0.8));
  }
  contest.begin(best);
  for (std::size_t z = 0; z < readings.zones.size(); ++z) {
    if (identifier.shape().zones[z].range.width() < 0.2) continue;
    WantedTerms with_zone = contest.best().terms;
    with_zone.emplace_back(ThermalFactor::zone, z);
    contest.consider(attempt(identifier, "and temperature of " + readings.zones[z].name, with_zone,
                             contest.best().hyper, 0.8));
  }
  // The body behind the sensor before the heating rate: it asks for one number more, the rate for two functions of x.
  const Tried quick = contest.best();
  if (temperature_varies && readings.time)
    if (auto lagged = with_lag(readings, quick, identifier.weights())) contest.consider(std::move(*lagged));
  if (rate_varies) {
    Tried with_rate = quick;
    with_rate.terms.emplace_back(ThermalFactor::rate);
    if (temperature_varies) with_rate.terms.emplace_back(ThermalFactor::rate_temperature);
    with_rate = attempt(identifier, "heating rate", with_rate.terms, quick.hyper, 0.8);
    contest.consider(with_rate);
    WantedTerms with_hysteresis = with_rate.terms;
    with_hysteresis.emplace_back(ThermalFactor::rate_curve);
    with_hysteresis.emplace_back(ThermalFactor::hysteresis);
    contest.consider(
        attempt(identifier, "heating rate and hysteresis", with_hysteresis, with_rate.hyper, 0.8));
  }

  const Tried& final = contest.best();
  ThermalRegression last{readings, final.candidate.lag};
  last.use(final.terms);
  last.reweigh(identifier.weights());
  const double noise = std::exp(final.hyper.at("noise"));
  const double unexplained = last.unexplained(final.posterior);
  fit.model = last.model(final.posterior, noise, unexplained);
  fit.predicted = last.predicted(final.posterior);
  const LoneOutliers judged = last.judged(readings.error - fit.predicted);
  fit.kept = judged.weights.cwiseProduct(identifier.weights());
  fit.in_stretches = judged.in_stretches;
  set_slopes(fit.model, temperature_varies);
  keep_zones_in_use(fit.model);

  fit.candidates = contest.verdicts();
  for (const ThermalTerm& term : fit.model.terms)
    if (term.factor == ThermalFactor::direction) fit.reversal = 2.0 * along_travel(term, fit.model).mean();

  if (!temperature_varies) fit.unidentified.emplace_back("temperature dependence");
  if (readings.heating_rate && !rate_varies) fit.unidentified.emplace_back("heating rate dependence");
  if (!temperature_varies)
    fit.notes.push_back(text("the temperature varies by %.2f K only: its effect cannot be told",
                             identifier.shape().temperature.width()));
  if (unexplained > 0.0)
    fit.unexplained.push_back(
        text("%.0f nm RMS of what is left goes on from one reading to the next: something that these columns "
             "do not tell "
             "moves the axis (sigma holds it)",
             1e9 * unexplained) +
        (readings.time ? "" : "; with the times `t [s]` a lag behind the thermistor could be told") +
        (readings.heating_rate ? "" : "; with `heating_rate [K/s]` heating and cooling could be told apart"));
  if (fit.in_stretches > 0)
    fit.unexplained.push_back(
        text("%.0f readings lie more than 4.5 standard deviations off in stretches that the model does not "
             "explain; "
             "a stretch is no outlier, all of these are fitted",
             static_cast<double>(fit.in_stretches)));
  if (auto branches = compare_branches(readings, readings.error - fit.predicted, fit.kept))
    fit.notes.push_back(*branches);
  return fit;
}

}  // namespace invar::metrology
