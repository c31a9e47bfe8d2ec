// Thermal error: how far an axis is off at a position, a temperature and a heating rate.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/base/range.hpp"
#include "core/numerics/lookup_table.hpp"

namespace invar::metrology {

inline constexpr std::size_t most_zones = 4;

/// Where the error is asked for. SI; temperature in degC, rate in K/s.
struct ThermalState {
  double x = 0.0;
  double temperature = 0.0;
  double heating_rate = 0.0;
  std::array<double, most_zones> zones{};  // degC, of further thermistors in the order of the model's zones
};

/// A further thermistor on another part of the machine, and the temperatures it was calibrated over.
struct ThermalZone {
  std::string name;
  Range range;         // [degC]
  double slope = 0.0;  // how fast the value may leave its end outside [m/K]
};

/// The factor by which a term's network over x is multiplied; tau is the temperature scaled to [-1, 1] over
/// its range, rho the heating rate scaled by its largest size.
enum class ThermalFactor {
  geometry,           // 1
  temperature,        // tau: expansion, linear in temperature
  temperature_curve,  // Gaussians of tau: the residual surface
  rate,               // rho: lag of the body behind the sensor, first order
  rate_temperature,   // rho tau
  rate_curve,         // Gaussians of rho
  hysteresis,         // tanh(rho / 0.05): heating against cooling, whatever the rate
  zone,               // the temperature of a zone, scaled to [-1, 1] over its range
  direction,          // direction of travel; its mean is zero, so it is never predicted
};
std::string name_of(ThermalFactor factor);
std::optional<ThermalFactor> thermal_factor(const std::string& name);

/// A constant, a slope and a bow over x, exact at any number of places, times the factors.
/// With u from -1 to 1 over the range of x: trend.row(0) + trend.row(1) u + trend.row(2) (1 - u^2). Beside
/// them sum_k phi((x - first - k spacing) / spacing) / sqrt(2 pi) * (weights.row(k) . factors), a Gaussian network
/// over x whose width is one spacing, for all that is finer.
struct ThermalTerm {
  ThermalFactor factor = ThermalFactor::geometry;
  double first = 0.0;       // centre [m]
  double spacing = 1.0;     // [m], also the width of the Gaussians
  Eigen::MatrixXd weights;  // centres x factors [m]
  std::size_t zone = 0;     // of factor `zone`: which
  Eigen::MatrixXd trend{};  // 3 x factors [m]; empty: none

  /// All numbers of the term, in the order of `thermal_basis`: weights, then trend, column by column.
  [[nodiscard]] Eigen::VectorXd coefficients() const;
  [[nodiscard]] Eigen::Index size() const { return weights.size() + trend.size(); }
};
inline constexpr Eigen::Index trend_size = 3;

/// The identified error of one axis: actual minus commanded position. Set-up and offline use; the loop
/// evaluates `CompiledThermalError`. Held at the end of each range outside it; sigma grows there by the
/// slopes.
struct ThermalError {
  std::vector<ThermalTerm> terms;
  Range x;                         // [m]
  Range temperature;               // [degC]
  Range heating_rate;              // [K/s]; empty width: rate unknown or constant
  std::vector<ThermalZone> zones;  // at most most_zones
  double lag = 0.0;                // time constant of the body behind the sensor [s]; 0: no lag state
  double noise = 0.0;              // of one reading [m]
  // How fast the value may leave its end outside: [m/m], [m/K], [m/(K/s)].
  double slope_x = 0.0;
  double slope_temperature = 0.0;
  double slope_rate = 0.0;
  /// Standard deviation inside: x, temperature, rate -> [m], the largest over the zones' temperatures.
  numerics::LookupTable<3> sigma_table;

  /// The state with every zone in the middle of its range, for looking at the rest.
  [[nodiscard]] ThermalState typical(double at_x, double at_temperature, double at_rate = 0.0) const;
  /// With `lag`, `at.temperature` is the lagged one, T - lag * rate in a steady ramp.
  [[nodiscard]] double value(const ThermalState& at) const;
  [[nodiscard]] double sigma(const ThermalState& at) const;
  [[nodiscard]] bool inside(const ThermalState& at) const;
};

/// The columns of a term at a state: activations of its centres and its trend times its factors, in the order of
/// `coefficients()`.
Eigen::VectorXd thermal_basis(const ThermalTerm& term, const ThermalError& model, const ThermalState& at,
                              double direction = 0.0);
int factor_count(ThermalFactor factor);

/// For the loop: `set` prepares the slow state (a few microseconds, no allocation), `value` and `sigma` cost
/// a table lookup in x. Real-time.
class CompiledThermalError {
 public:
  /// `most_difference` [m] bounds the difference from the model between the nodes in x.
  CompiledThermalError(const ThermalError& model, double most_difference);

  void set(double temperature, double heating_rate,
           const std::array<double, most_zones>& zones = {}) noexcept;
  [[nodiscard]] double value(double x) const noexcept;
  [[nodiscard]] double sigma(double x) const noexcept;
  /// False where temperature, rate or a zone's temperature as set lie outside what was calibrated.
  [[nodiscard]] bool inside() const noexcept { return inside_; }
  [[nodiscard]] double bound() const noexcept { return bound_; }

 private:
  struct Column {
    ThermalFactor factor;
    int index;  // of the factor
    std::size_t zone;
    std::size_t begin;  // in columns_
  };
  Range x_;
  Range temperature_;
  Range heating_rate_;
  std::vector<ThermalZone> zones_;
  double slope_x_, slope_temperature_, slope_rate_;
  double bound_ = 0.0;
  std::size_t nodes_ = 2;
  double inverse_step_ = 0.0;
  std::vector<Column> layout_;
  std::vector<double> columns_;  // each factor's network over x at the nodes
  std::vector<double> values_;   // at the nodes, for the state as set
  std::vector<double> sigmas_;
  numerics::LookupTable<3> sigma_table_;
  double outside_squared_ = 0.0;
  bool inside_ = false;
};

/// One step of the lagged temperature: from `lagged` on, while the temperature goes straight from `from` to `to` in
/// `dt` [s]; `tau` [s] > 0. Exact. Real-time.
[[nodiscard]] double lag_step(double lagged, double from, double to, double dt, double tau) noexcept;

/// The lagged temperature Tm of tau dTm/dt = T - Tm, T linear between readings (exact). Starts in
/// equilibrium. `time` [s] ascending; `tau` [s] > 0.
Eigen::VectorXd lagged_temperature(const Eigen::Ref<const Eigen::VectorXd>& time,
                                   const Eigen::Ref<const Eigen::VectorXd>& temperature, double tau);

}  // namespace invar::metrology
