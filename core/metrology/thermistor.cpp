#include "core/metrology/thermistor.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {
constexpr double zero_celsius = 273.15;  // [K]
}

double Thermistor::resistance(double temperature) const {
  const double base = base_temperature + zero_celsius;
  return resistance_at_base * std::exp(coefficient_percent / 100.0 * base * base *
                                       (1.0 / (temperature + zero_celsius) - 1.0 / base));
}

double Thermistor::temperature(double resistance) const {
  const double base = base_temperature + zero_celsius;
  const double beta = coefficient_percent / 100.0 * base * base;
  return 1.0 / (1.0 / base + std::log(resistance / resistance_at_base) / beta) - zero_celsius;
}

ThermistorFit fit_thermistor(const Eigen::Ref<const Eigen::VectorXd>& temperature,
                             const Eigen::Ref<const Eigen::VectorXd>& resistance, double base_temperature) {
  const Eigen::Index n = temperature.size();
  INVAR_EXPECTS(n >= 2 && resistance.size() == n && resistance.minCoeff() > 0.0, n, resistance.size());
  const double base = base_temperature + zero_celsius;
  Eigen::MatrixXd a(n, 2);
  a.col(0).setOnes();
  a.col(1) = (temperature.array() + zero_celsius).inverse() - 1.0 / base;
  const Eigen::VectorXd y = resistance.array().log();
  const Eigen::Vector2d solution = a.colPivHouseholderQr().solve(y);
  ThermistorFit fit;
  fit.thermistor = {std::exp(solution(0)), base_temperature, 100.0 * solution(1) / (base * base)};
  double squares = 0.0;
  for (Eigen::Index i = 0; i < n; ++i)
    squares += std::pow(fit.thermistor.temperature(resistance(i)) - temperature(i), 2);
  fit.rms = std::sqrt(squares / static_cast<double>(n));
  fit.sigma_coefficient = std::numeric_limits<double>::infinity();
  if (n > 2) {
    const double variance = (y - a * solution).squaredNorm() / static_cast<double>(n - 2);
    const Eigen::Matrix2d covariance = (a.transpose() * a).inverse();
    fit.sigma_coefficient = 100.0 / (base * base) * std::sqrt(variance * covariance(1, 1));
  }
  return fit;
}

}  // namespace invar::metrology
