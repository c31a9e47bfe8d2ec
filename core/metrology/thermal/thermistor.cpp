#include "core/metrology/thermal/thermistor.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

constexpr double zero_celsius = 273.15;  // [K]
constexpr double unknown = std::numeric_limits<double>::infinity();
constexpr double exact = 1e-6;  // [K]: below it both equations meet the readings, and rounding would choose

/// 1/T = A + B x + C x^3, x = ln(R / 1 ohm); A, B and, where there is a third, C.
struct InverseFit {
  Eigen::VectorXd coefficients;
  double sigma_slope = unknown;
  double held_out = unknown;  // RMS of each reading by all others [K]

  [[nodiscard]] double third_order() const { return coefficients.size() == 3 ? coefficients(2) : 0.0; }
  [[nodiscard]] double slope(double x) const { return coefficients(1) + 3.0 * third_order() * x * x; }
  [[nodiscard]] double value(double x) const {
    return coefficients(0) + coefficients(1) * x + third_order() * x * x * x;
  }
};

/// Least squares of the temperatures: an error of 1/T counts by T^2.
InverseFit fit_inverse(const Eigen::VectorXd& kelvins, const Eigen::VectorXd& x, Eigen::Index terms) {
  const Eigen::Index n = x.size();
  const Eigen::VectorXd weight = kelvins.array().square();
  Eigen::MatrixXd a(n, terms);
  a.col(0).setOnes();
  a.col(1) = x;
  if (terms == 3) a.col(2) = x.array().cube();
  a = weight.asDiagonal() * a;
  const Eigen::VectorXd y = weight.array() / kelvins.array();
  // Columns of one size: ln R cubed is a thousand times 1.
  const Eigen::VectorXd size = a.colwise().norm();
  const Eigen::MatrixXd scaled = a * size.cwiseInverse().asDiagonal();
  InverseFit fit;
  fit.coefficients = numerics::least_squares(scaled, y).cwiseQuotient(size);
  if (n <= terms) return fit;
  const Eigen::VectorXd left = y - a * fit.coefficients;
  const Eigen::MatrixXd covariance =
      numerics::solve_square(scaled.transpose() * scaled, Eigen::MatrixXd::Identity(terms, terms));
  const double variance = left.squaredNorm() / static_cast<double>(n - terms);
  fit.sigma_slope = std::sqrt(variance * covariance(1, 1)) / size(1);
  double squares = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double leverage = scaled.row(i) * covariance * scaled.row(i).transpose();
    squares += std::pow(left(i) / std::max(1.0 - leverage, 1e-12), 2);
  }
  fit.held_out = std::sqrt(squares / static_cast<double>(n));
  return fit;
}

/// ln R where the equation gives 1/T; the equation falls with T in between.
double solve(const InverseFit& fit, double inverse, double start) {
  double x = start;
  for (int i = 0; i < 50; ++i) {
    const double step = (inverse - fit.value(x)) / fit.slope(x);
    x += step;
    if (!(std::abs(step) > 1e-14 * (1.0 + std::abs(x)))) break;
  }
  return x;
}

/// Resistance falls with temperature over all readings, and at the base.
bool falls(const InverseFit& fit, const Eigen::VectorXd& x, double x_base) {
  return fit.slope(x.minCoeff()) > 0.0 && fit.slope(x.maxCoeff()) > 0.0 && fit.slope(x_base) > 0.0 &&
         std::isfinite(x_base);
}

Thermistor thermistor_of(const InverseFit& fit, double x_base, double base_temperature) {
  const double base = base_temperature + zero_celsius;
  return {std::exp(x_base), base_temperature, 100.0 / (fit.slope(x_base) * base * base), fit.third_order()};
}

}  // namespace

double Thermistor::resistance(double temperature) const {
  const double base = base_temperature + zero_celsius;
  const double inverse = 1.0 / (temperature + zero_celsius) - 1.0 / base;
  const double beta = coefficient_percent / 100.0 * base * base;
  if (third_order == 0.0) return resistance_at_base * std::exp(beta * inverse);
  const double x_base = std::log(resistance_at_base);
  InverseFit equation;
  equation.coefficients = Eigen::Vector3d{0.0, 1.0 / beta - 3.0 * third_order * x_base * x_base, third_order};
  equation.coefficients(0) = 1.0 / base - equation.value(x_base);
  return std::exp(solve(equation, 1.0 / (temperature + zero_celsius), x_base + beta * inverse));
}

double Thermistor::temperature(double resistance) const {
  const double base = base_temperature + zero_celsius;
  const double beta = coefficient_percent / 100.0 * base * base;
  const double x_base = std::log(resistance_at_base), beyond = std::log(resistance / resistance_at_base);
  // x^3 - x_B^3 - 3 x_B^2 (x - x_B), without the difference of large numbers
  const double bend = beyond * beyond * (beyond + 3.0 * x_base);
  return 1.0 / (1.0 / base + beyond / beta + third_order * bend) - zero_celsius;
}

ThermistorFit fit_thermistor(const Eigen::Ref<const Eigen::VectorXd>& temperature,
                             const Eigen::Ref<const Eigen::VectorXd>& resistance, double base_temperature) {
  const Eigen::Index n = temperature.size();
  INVAR_EXPECTS(n >= 2 && resistance.size() == n && resistance.minCoeff() > 0.0, n, resistance.size());
  const double base = base_temperature + zero_celsius;
  const Eigen::VectorXd kelvins = temperature.array() + zero_celsius, x = resistance.array().log();
  const InverseFit simple = fit_inverse(kelvins, x, 2);
  double x_base = (1.0 / base - simple.coefficients(0)) / simple.coefficients(1);
  ThermistorFit fit;
  fit.thermistor = thermistor_of(simple, x_base, base_temperature);
  fit.sigma_coefficient =
      fit.thermistor.coefficient_percent * simple.sigma_slope / std::abs(simple.coefficients(1));
  fit.held_out_b = simple.held_out;
  fit.held_out_steinhart_hart = unknown;
  if (n > 3) {
    const InverseFit full = fit_inverse(kelvins, x, 3);
    x_base = solve(full, 1.0 / base, x_base);
    if (falls(full, x, x_base)) fit.held_out_steinhart_hart = full.held_out;
    if (fit.held_out_b > exact && fit.held_out_steinhart_hart < fit.held_out_b) {
      fit.thermistor = thermistor_of(full, x_base, base_temperature);
      fit.sigma_coefficient = fit.thermistor.coefficient_percent * full.sigma_slope / full.slope(x_base);
    }
  }
  double squares = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double error = std::abs(fit.thermistor.temperature(resistance(i)) - temperature(i));
    squares += error * error;
    fit.largest = std::max(fit.largest, error);
  }
  fit.rms = std::sqrt(squares / static_cast<double>(n));
  return fit;
}

}  // namespace invar::metrology
