#include "core/metrology/thermal/thermal_error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

constexpr int curve_centres = 5;
constexpr double curve_spacing = 0.6;  // of the scaled input: centres at -1.2 .. 1.2, width one spacing

constexpr std::pair<ThermalFactor, const char*> names[] = {
    {ThermalFactor::geometry, "geometry"},
    {ThermalFactor::temperature, "temperature"},
    {ThermalFactor::temperature_curve, "temperature_curve"},
    {ThermalFactor::rate, "rate"},
    {ThermalFactor::rate_temperature, "rate_temperature"},
    {ThermalFactor::rate_curve, "rate_curve"},
    {ThermalFactor::hysteresis, "hysteresis"},
    {ThermalFactor::zone, "zone"},
    {ThermalFactor::direction, "direction"}};

double curve(double scaled, int k) noexcept {
  const double z = scaled / curve_spacing - (k - curve_centres / 2);
  return std::exp(-0.5 * z * z);
}

/// The value of one factor; `tau`, `rho` and `zone` are held to their ranges already.
double factor_value(ThermalFactor factor, int k, double tau, double rho, double zone,
                    double direction) noexcept {
  switch (factor) {
    case ThermalFactor::geometry:
      return 1.0;
    case ThermalFactor::temperature:
      return tau;
    case ThermalFactor::temperature_curve:
      return curve(tau, k);
    case ThermalFactor::rate:
      return rho;
    case ThermalFactor::rate_temperature:
      return rho * tau;
    case ThermalFactor::rate_curve:
      return curve(rho, k);
    case ThermalFactor::hysteresis:
      return std::tanh(rho / 0.05);
    case ThermalFactor::zone:
      return zone;
    case ThermalFactor::direction:
      return direction;
  }
  return 0.0;
}

double scaled_temperature(const Range& range, double temperature) noexcept {
  const double half = 0.5 * range.width();
  return half > 0.0 ? (range.clamp(temperature) - range.lower - half) / half : 0.0;
}

double scaled_rate(const Range& range, double rate) noexcept {
  const double size = std::max(std::abs(range.lower), std::abs(range.upper));
  return range.width() > 0.0 && size > 0.0 ? range.clamp(rate) / size : 0.0;
}

/// The functions of `ThermalTerm::trend` at a place inside the range.
Eigen::Vector3d trend_at(const Range& range, double x) noexcept {
  const double half = 0.5 * range.width();
  const double u = half > 0.0 ? (x - range.lower - half) / half : 0.0;
  return {1.0, u, 1.0 - u * u};
}

/// What one factor is multiplied by at a place inside the range.
double over_x(const ThermalTerm& term, const Range& range, double x, Eigen::Index factor) {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < term.weights.rows(); ++k) {
    const double z = (x - term.first) / term.spacing - static_cast<double>(k);
    sum += term.weights(k, factor) * std::exp(-0.5 * z * z);
  }
  sum /= std::sqrt(2.0 * std::numbers::pi);
  return term.trend.size() == 0 ? sum : sum + trend_at(range, x).dot(term.trend.col(factor));
}

}  // namespace

Eigen::VectorXd ThermalTerm::coefficients() const {
  Eigen::VectorXd all(size());
  all << weights.reshaped(), trend.reshaped();
  return all;
}

std::string name_of(ThermalFactor factor) {
  for (const auto& [value, name] : names)
    if (value == factor) return name;
  return {};
}

std::optional<ThermalFactor> thermal_factor(const std::string& name) {
  for (const auto& [value, text] : names)
    if (name == text) return value;
  return std::nullopt;
}

int factor_count(ThermalFactor factor) {
  return factor == ThermalFactor::temperature_curve || factor == ThermalFactor::rate_curve ? curve_centres
                                                                                           : 1;
}

Eigen::VectorXd thermal_basis(const ThermalTerm& term, const ThermalError& model, const ThermalState& at,
                              double direction) {
  const double tau = scaled_temperature(model.temperature, at.temperature);
  const double rho = scaled_rate(model.heating_rate, at.heating_rate);
  const double zone = term.factor == ThermalFactor::zone
                          ? scaled_temperature(model.zones[term.zone].range, at.zones[term.zone])
                          : 0.0;
  const double x = model.x.clamp(at.x);
  const Eigen::Index centres = term.weights.rows();
  const int factors = factor_count(term.factor);
  Eigen::VectorXd columns(term.size());
  for (Eigen::Index k = 0; k < centres; ++k) {
    const double z = (x - term.first) / term.spacing - static_cast<double>(k);
    const double phi = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
    for (int f = 0; f < factors; ++f)
      columns(f * centres + k) = phi * factor_value(term.factor, f, tau, rho, zone, direction);
  }
  if (term.trend.size() > 0)
    for (int f = 0; f < factors; ++f)
      columns.segment<trend_size>(centres * factors + trend_size * f) =
          factor_value(term.factor, f, tau, rho, zone, direction) * trend_at(model.x, x);
  return columns;
}

ThermalState ThermalError::typical(double at_x, double at_temperature, double at_rate) const {
  ThermalState at{at_x, at_temperature, at_rate, {}};
  for (std::size_t z = 0; z < zones.size(); ++z)
    at.zones[z] = 0.5 * (zones[z].range.lower + zones[z].range.upper);
  return at;
}

double ThermalError::value(const ThermalState& at) const {
  double sum = 0.0;
  for (const ThermalTerm& term : terms)
    if (term.factor != ThermalFactor::direction)
      sum += thermal_basis(term, *this, at).dot(term.coefficients());
  return sum;
}

double ThermalError::sigma(const ThermalState& at) const {
  const double within = sigma_table({at.x, at.temperature, at.heating_rate});
  double sum = std::hypot(std::hypot(within, slope_x * (at.x - x.clamp(at.x))),
                          std::hypot(slope_temperature * (at.temperature - temperature.clamp(at.temperature)),
                                     slope_rate * (at.heating_rate - heating_rate.clamp(at.heating_rate))));
  for (std::size_t z = 0; z < zones.size(); ++z)
    sum = std::hypot(sum, zones[z].slope * (at.zones[z] - zones[z].range.clamp(at.zones[z])));
  return sum;
}

bool ThermalError::inside(const ThermalState& at) const {
  const bool rate_known = heating_rate.width() > 0.0;
  bool zones_inside = true;
  for (std::size_t z = 0; z < zones.size(); ++z)
    zones_inside = zones_inside && zones[z].range.contains(at.zones[z]);
  return x.contains(at.x) && temperature.contains(at.temperature) && zones_inside &&
         (!rate_known || heating_rate.contains(at.heating_rate));
}

CompiledThermalError::CompiledThermalError(const ThermalError& model, double most_difference)
    : x_{model.x},
      temperature_{model.temperature},
      heating_rate_{model.heating_rate},
      zones_{model.zones},
      slope_x_{model.slope_x},
      slope_temperature_{model.slope_temperature},
      slope_rate_{model.slope_rate},
      sigma_table_{model.sigma_table} {
  INVAR_EXPECTS(most_difference > 0.0, most_difference);
  // |d2/dx2| of a network is at most sum |w| / (spacing^2 sqrt(2 pi)), of a bow 2 |c| / half^2; factors are at most 1
  // in size.
  double curvature = 0.0;
  const double half = std::max(0.5 * x_.width(), 1e-12);
  for (const ThermalTerm& term : model.terms) {
    if (term.factor == ThermalFactor::direction) continue;
    curvature +=
        term.weights.cwiseAbs().sum() / (term.spacing * term.spacing * std::sqrt(2.0 * std::numbers::pi));
    if (term.trend.size() > 0) curvature += 2.0 * term.trend.row(2).cwiseAbs().sum() / (half * half);
  }
  const double intervals = std::ceil(x_.width() * std::sqrt(curvature / (8.0 * most_difference)));
  nodes_ = static_cast<std::size_t>(std::clamp(intervals, 1.0, 20000.0)) + 1;
  const double step = x_.width() / static_cast<double>(nodes_ - 1);
  inverse_step_ = step > 0.0 ? 1.0 / step : 0.0;
  bound_ = curvature * step * step / 8.0;
  for (const ThermalTerm& term : model.terms) {
    if (term.factor == ThermalFactor::direction) continue;
    for (int f = 0; f < factor_count(term.factor); ++f) {
      layout_.push_back({term.factor, f, term.zone, columns_.size()});
      for (std::size_t i = 0; i < nodes_; ++i)
        columns_.push_back(over_x(term, x_, x_.lower + step * static_cast<double>(i), f));
    }
  }
  values_.assign(nodes_, 0.0);
  sigmas_.assign(nodes_, 0.0);
  set(0.5 * (temperature_.lower + temperature_.upper), 0.0, model.typical(0.0, 0.0).zones);
}

void CompiledThermalError::set(double temperature, double heating_rate,
                               const std::array<double, most_zones>& zones) noexcept {
  const double tau = scaled_temperature(temperature_, temperature);
  const double rho = scaled_rate(heating_rate_, heating_rate);
  std::fill(values_.begin(), values_.end(), 0.0);
  for (const Column& column : layout_) {
    const double zone = column.factor == ThermalFactor::zone
                            ? scaled_temperature(zones_[column.zone].range, zones[column.zone])
                            : 0.0;
    const double factor = factor_value(column.factor, column.index, tau, rho, zone, 0.0);
    for (std::size_t i = 0; i < nodes_; ++i) values_[i] += factor * columns_[column.begin + i];
  }
  const double beyond_t = slope_temperature_ * (temperature - temperature_.clamp(temperature));
  const double beyond_r = slope_rate_ * (heating_rate - heating_rate_.clamp(heating_rate));
  outside_squared_ = beyond_t * beyond_t + beyond_r * beyond_r;
  const bool rate_known = heating_rate_.width() > 0.0;
  inside_ = temperature_.contains(temperature) && (!rate_known || heating_rate_.contains(heating_rate));
  for (std::size_t z = 0; z < zones_.size(); ++z) {
    const double beyond = zones_[z].slope * (zones[z] - zones_[z].range.clamp(zones[z]));
    outside_squared_ += beyond * beyond;
    inside_ = inside_ && zones_[z].range.contains(zones[z]);
  }
  for (std::size_t i = 0; i < nodes_; ++i) {
    const double x = x_.lower + x_.width() * static_cast<double>(i) / static_cast<double>(nodes_ - 1);
    sigmas_[i] = sigma_table_({x, temperature, heating_rate});
  }
}

double CompiledThermalError::value(double x) const noexcept {
  double at = (x - x_.lower) * inverse_step_;
  const double last = static_cast<double>(nodes_ - 1);
  at = at > 0.0 ? (at < last ? at : last) : 0.0;
  const auto cell = std::min(static_cast<std::size_t>(at), nodes_ - 2);
  const double fraction = at - static_cast<double>(cell);
  return values_[cell] + fraction * (values_[cell + 1] - values_[cell]);
}

double CompiledThermalError::sigma(double x) const noexcept {
  double at = (x - x_.lower) * inverse_step_;
  const double last = static_cast<double>(nodes_ - 1);
  at = at > 0.0 ? (at < last ? at : last) : 0.0;
  const auto cell = std::min(static_cast<std::size_t>(at), nodes_ - 2);
  const double fraction = at - static_cast<double>(cell);
  const double within = sigmas_[cell] + fraction * (sigmas_[cell + 1] - sigmas_[cell]);
  const double beyond = slope_x_ * (x - x_.clamp(x));
  return std::sqrt(within * within + beyond * beyond + outside_squared_);
}

double lag_step(double lagged, double from, double to, double dt, double tau) noexcept {
  if (!(dt > 0.0)) return lagged;
  // T(t) = T0 + s t over the step: Tm = T0 + s (t - tau) + (Tm0 - T0 + s tau) exp(-t / tau).
  const double slope = (to - from) / dt;
  return to - slope * tau + (lagged - from + slope * tau) * std::exp(-dt / tau);
}

Eigen::VectorXd lagged_temperature(const Eigen::Ref<const Eigen::VectorXd>& time,
                                   const Eigen::Ref<const Eigen::VectorXd>& temperature, double tau) {
  INVAR_EXPECTS(time.size() == temperature.size() && tau > 0.0, time.size(), temperature.size(), tau);
  Eigen::VectorXd lagged(time.size());
  if (time.size() == 0) return lagged;
  lagged(0) = temperature(0);
  for (Eigen::Index i = 1; i < time.size(); ++i)
    lagged(i) = lag_step(lagged(i - 1), temperature(i - 1), temperature(i), time(i) - time(i - 1), tau);
  return lagged;
}

}  // namespace invar::metrology
