#include "core/metrology/thermal/thermal_regression.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

using numerics::NormalEquations;
using numerics::Posterior;

/// Cholesky factor of a Matern covariance over `count` uniform points, plus a constant of variance `constant`.
Eigen::MatrixXd covariance_factor(Eigen::Index count, double step, double length, double constant) {
  Eigen::MatrixXd k(count, count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      k(i, j) = k(j, i) = constant + numerics::matern52(static_cast<double>(i - j) * step, length);
  k.diagonal().array() += 1e-9 * (1.0 + constant);
  return k.llt().matrixL();
}

/// Each column of `outer` times each of `inner`: the factor of the product of two covariances.
Eigen::MatrixXd product(const Eigen::MatrixXd& outer, const Eigen::MatrixXd& inner) {
  Eigen::MatrixXd both = Eigen::MatrixXd::Zero(outer.rows() * inner.rows(), outer.rows() * inner.rows());
  for (Eigen::Index i = 0; i < outer.rows(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      both.block(i * inner.rows(), j * inner.rows(), inner.rows(), inner.rows()) = outer(i, j) * inner;
  return both;
}

/// Places that are apart by less than this share of the travel are one.
constexpr double one_place = 1.0 / 400.0;

/// Number of each reading's place along the travel, from 0.
std::vector<int> places_of(const Eigen::VectorXd& x) {
  std::vector<std::size_t> order(static_cast<std::size_t>(x.size()));
  std::iota(order.begin(), order.end(), 0U);
  const auto at = [&](std::size_t i) { return x(static_cast<Eigen::Index>(i)); };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return at(a) < at(b); });
  std::vector<int> place(order.size(), 0);
  double begin = at(order.front());
  int number = 0;
  for (const std::size_t i : order) {
    if (at(i) - begin > one_place * (x.maxCoeff() - x.minCoeff())) {
      begin = at(i);
      ++number;
    }
    place[i] = number;
  }
  return place;
}

// How far a bow reaches in the middle, assumed where two places show none: this share of what the error spans, or of
// what steel grows over the travel and the temperatures. A tenth is what an axis bends whose middle is warmer than its
// ends by a tenth of the heating.
constexpr double usual_bow = 0.1;
constexpr double growth_of_steel = 12e-6;  // 1/K

constexpr double finest = 1e-9;  // m, what no reading of a machine is better than

/// Standard deviation by the median deviation, or the plain one where half of the values are equal.
double robust_size(const Eigen::VectorXd& values) {
  const std::vector<double> list{values.begin(), values.end()};
  const double robust = numerics::robust_deviation(list, numerics::median(list));
  return robust > 0.0 ? robust : std::sqrt((values.array() - values.mean()).square().mean());
}

}  // namespace

Eigen::VectorXd ThermalReadings::lagged(double lag) const {
  if (history.time.empty()) return lagged_temperature(*time, temperature, lag);
  const auto map = [](const std::vector<double>& v) {
    return Eigen::Map<const Eigen::VectorXd>{v.data(), static_cast<Eigen::Index>(v.size())};
  };
  const Eigen::VectorXd body = lagged_temperature(map(history.time), map(history.temperature), lag);
  Eigen::VectorXd at(x.size());
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < at.size(); ++i) {
    const double now = (*time)(i);
    while (k + 1 < history.time.size() && history.time[k + 1] <= now) ++k;
    const auto here = static_cast<Eigen::Index>(k);
    // On from the last point of the history at the reading's own temperature.
    at(i) = now > history.time[k]
                ? lag_step(body(here), history.temperature[k], temperature(i), now - history.time[k], lag)
                : body(here);
  }
  return at;
}

ThermalRegression::ThermalRegression(const ThermalReadings& readings, double lag) : readings_{readings} {
  const Eigen::VectorXd temperature = lag > 0.0 ? readings.lagged(lag) : readings.temperature;
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
  places_ = places_of(readings.x);
  positions_ = std::clamp(*std::max_element(places_.begin(), places_.end()) + 1, 2, 41);
  weights_ = Eigen::VectorXd::Ones(readings.x.size());
}

void ThermalRegression::use(const WantedTerms& factors) {
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
    term.trend = Eigen::MatrixXd::Zero(trend_size, factor_count(factor));
    columns += term.size();
    terms_.push_back(std::move(term));
  }
  rows_.resize(readings_.x.size(), columns);
  for (Eigen::Index i = 0; i < rows_.rows(); ++i) rows_.row(i) = basis(i).transpose();
  sums_ = NormalEquations::of(rows_, readings_.error, weights_);
}

void ThermalRegression::reweigh(const Eigen::VectorXd& weights) {
  weights_ = weights;
  sums_ = NormalEquations::of(rows_, readings_.error, weights_);
}

Posterior ThermalRegression::fit(const ThermalHyper& hyper, numerics::Covariance covariance) const {
  return posterior(sums_, prior(hyper), std::exp(hyper.at("noise")), covariance);
}

void ThermalRegression::search(ThermalHyper& hyper, double step) const {
  const auto defaults = typical();
  std::vector<std::string> names;
  for (const std::string& name : needed()) {
    hyper.try_emplace(name, defaults.at(name));
    names.push_back(name);
  }
  Eigen::VectorXd start(static_cast<Eigen::Index>(names.size()));
  for (Eigen::Index k = 0; k < start.size(); ++k) start(k) = hyper.at(names[static_cast<std::size_t>(k)]);
  const auto objective = [&](const Eigen::VectorXd& p) {
    ThermalHyper trial = hyper;
    double log_prior = 0.0;
    for (Eigen::Index k = 0; k < p.size(); ++k) {
      const std::string& name = names[static_cast<std::size_t>(k)];
      trial[name] = p(k);
      const double spread = name.ends_with("length") ? 1.0 : 3.0;
      log_prior -= 0.5 * std::pow((p(k) - defaults.at(name)) / spread, 2);
    }
    return fit(trial, numerics::Covariance::left_out).log_evidence + log_prior;
  };
  const Eigen::VectorXd best = numerics::maximise(objective, start, step, 0.2);
  for (Eigen::Index k = 0; k < best.size(); ++k) hyper[names[static_cast<std::size_t>(k)]] = best(k);
}

LoneOutliers ThermalRegression::judged(const Eigen::VectorXd& residual) const {
  return lone_outliers(residual, places_, 4.5 * std::max(robust_size(residual), finest));
}

void ThermalRegression::reject_outliers() {
  ThermalHyper hyper = typical();
  Eigen::VectorXd residual = readings_.error;
  for (int round = 0; round < 8; ++round) {
    hyper["noise"] = std::log(std::max(0.3 * robust_size(residual), 1e-12));
    const Posterior p = fit(hyper, numerics::Covariance::left_out);
    residual = readings_.error - rows_ * p.mean;
    const double sigma = std::max(robust_size(residual), finest);
    reweigh((1.0 + (residual.array() / (2.0 * sigma)).square()).inverse());
  }
  reweigh(judged(residual).weights);
}

ThermalHyper ThermalRegression::typical() const {
  const double span = std::max(shape_.x.width(), 1e-12);
  ThermalHyper hyper{{"noise", std::log(0.1 * scale_)},
                     {"length", std::log(0.2 * span)},
                     {"thermal_length", std::log(0.5 * span)},
                     {"temperature_length", std::log(2.0)},
                     {"rate_length", std::log(2.0)}};
  for (int f = 0; f <= static_cast<int>(ThermalFactor::direction); ++f) {
    const auto factor = static_cast<ThermalFactor>(f);
    hyper["size_" + name_of(factor)] = std::log(0.05 * scale_);
  }
  return hyper;
}

double ThermalRegression::left_out_rms(const Posterior& p, double noise) const {
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

double ThermalRegression::held_out_rms(const ThermalHyper& hyper) const {
  constexpr int folds = 5;
  std::vector<int> fold(static_cast<std::size_t>(readings_.x.size()), 0);
  int pass = 0;
  double way = 0.0;
  for (Eigen::Index i = 1; i < readings_.x.size(); ++i) {
    const double step = readings_.x(i) - readings_.x(i - 1);
    if (step * way < 0.0) ++pass;
    if (step != 0.0) way = step;
    fold[static_cast<std::size_t>(i)] = pass % folds;
  }
  double squares = 0.0;
  double count = 0.0;
  for (int out = 0; out < std::min(folds, pass + 1); ++out) {
    Eigen::VectorXd kept = weights_;
    for (std::size_t i = 0; i < fold.size(); ++i)
      if (fold[i] == out) kept(static_cast<Eigen::Index>(i)) = 0.0;
    const auto p = posterior(NormalEquations::of(rows_, readings_.error, kept), prior(hyper),
                             std::exp(hyper.at("noise")), numerics::Covariance::left_out);
    for (std::size_t k = 0; k < fold.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      if (fold[k] != out || weights_(i) <= 0.0) continue;
      squares += std::pow(readings_.error(i) - rows_.row(i).dot(p.mean), 2);
      count += 1.0;
    }
  }
  return std::sqrt(squares / std::max(count, 1.0));
}

double ThermalRegression::unexplained(const Posterior& p) const {
  const Eigen::VectorXd residual = readings_.error - rows_ * p.mean;
  double together = 0.0;
  double pairs = 0.0;
  double squares = 0.0;
  for (Eigen::Index i = 1; i < residual.size(); ++i) {
    if (weights_(i) <= 0.0 || weights_(i - 1) <= 0.0) continue;
    together += residual(i) * residual(i - 1);
    squares += residual(i) * residual(i);
    pairs += 1.0;
  }
  // Of white residuals the sum of products has the standard deviation `squares` / sqrt(pairs).
  return together > 3.0 * squares / std::sqrt(pairs) ? std::sqrt(together / pairs) : 0.0;
}

ThermalError ThermalRegression::model(const Posterior& p, double noise, double unexplained) const {
  ThermalError result = shape_;
  result.terms = terms_;
  result.noise = noise;
  Eigen::Index at = 0;
  for (ThermalTerm& term : result.terms) {
    term.weights = p.mean.segment(at, term.weights.size()).reshaped(term.weights.rows(), term.weights.cols());
    at += term.weights.size();
    term.trend = p.mean.segment(at, term.trend.size()).reshaped(trend_size, term.trend.cols());
    at += term.trend.size();
  }
  const bool rate = result.heating_rate.width() > 0.0;
  const bool temperature = result.temperature.width() > 0.0;
  const int between = (15 + positions_) / positions_;  // nodes from one place to the next: sigma grows there
  const std::array<numerics::GridAxis, 3> axes{
      numerics::GridAxis{result.x, static_cast<std::size_t>((positions_ - 1) * between + 1)},
      numerics::GridAxis{result.temperature, temperature ? 9U : 1U},
      numerics::GridAxis{result.heating_rate, rate ? 5U : 1U}};
  result.sigma_table = numerics::LookupTable<3>{
      axes, [&](const std::array<double, 3>& node) {
        double most = 0.0;
        for (const ThermalState& state : with_zones({node[0], node[1], node[2], {}})) {
          const Eigen::VectorXd columns = basis(state, 0.0);
          most = std::max(most, columns.dot(p.covariance * columns));
        }
        return std::hypot(std::sqrt(most), unexplained);
      }};
  return result;
}

Eigen::VectorXd ThermalRegression::basis(const ThermalState& at, double direction) const {
  Eigen::Index total = 0;
  for (const ThermalTerm& term : terms_) total += term.size();
  Eigen::VectorXd columns(total);
  Eigen::Index begin = 0;
  for (const ThermalTerm& term : terms_) {
    columns.segment(begin, term.size()) = thermal_basis(term, shape_, at, direction);
    begin += term.size();
  }
  return columns;
}

Eigen::VectorXd ThermalRegression::basis(Eigen::Index i) const {
  ThermalState at{
      readings_.x(i), temperature_(i), readings_.heating_rate ? (*readings_.heating_rate)(i) : 0.0, {}};
  for (std::size_t z = 0; z < readings_.zones.size(); ++z) at.zones[z] = readings_.zones[z].temperature(i);
  return basis(at, readings_.direction ? (*readings_.direction)(i) : 0.0);
}

/// The state with all zones cold and with all warm.
std::array<ThermalState, 2> ThermalRegression::with_zones(const ThermalState& at) const {
  std::array<ThermalState, 2> both{at, at};
  for (std::size_t z = 0; z < shape_.zones.size(); ++z) {
    both[0].zones[z] = shape_.zones[z].range.lower;
    both[1].zones[z] = shape_.zones[z].range.upper;
  }
  return both;
}

std::vector<std::string> ThermalRegression::needed() const {
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

std::vector<Eigen::MatrixXd> ThermalRegression::prior(const ThermalHyper& hyper) const {
  std::vector<Eigen::MatrixXd> factors;
  const double growth = growth_of_steel * shape_.x.width() * std::max(shape_.temperature.width(), 1.0);
  const double unseen_bow = usual_bow * std::max(1.0, growth / scale_);
  for (const ThermalTerm& term : terms_) {
    const double size = std::exp(hyper.at("size_" + name_of(term.factor)));
    const bool geometry = term.factor == ThermalFactor::geometry;
    const bool rate = term.factor == ThermalFactor::rate_curve;
    const Eigen::MatrixXd over_x =
        size * covariance_factor(term.weights.rows(), term.spacing,
                                 std::exp(hyper.at(geometry ? "length" : "thermal_length")), 0.0);
    const Eigen::MatrixXd over_factor =
        term.weights.cols() == 1
            ? Eigen::MatrixXd{Eigen::MatrixXd::Ones(1, 1)}
            : covariance_factor(term.weights.cols(), 0.6,
                                std::exp(hyper.at(rate ? "rate_length" : "temperature_length")), 0.0);
    // Constant, slope and bow of the geometry and of the linear expansion are free; elsewhere they are like the rest.
    const bool free =
        geometry || term.factor == ThermalFactor::temperature || term.factor == ThermalFactor::zone;
    const Eigen::Vector3d trend =
        free ? Eigen::Vector3d{10.0, 10.0, positions_ > 2 ? 10.0 : unseen_bow} * scale_
             : Eigen::Vector3d{1.0, 1.0, 0.5} * size;
    factors.push_back(product(over_factor, over_x));
    factors.push_back(product(over_factor, trend.asDiagonal()));
  }
  return factors;
}

}  // namespace invar::metrology
