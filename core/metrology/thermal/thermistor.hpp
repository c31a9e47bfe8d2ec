// The equation of an NTC thermistor, and its calibration: the B law of thesis (3.3), corrected, or Steinhart-Hart.
#pragma once

#include <Eigen/Core>

namespace invar::metrology {

/// 1/T = 1/T_B + (x - x_B) / B + C (x^3 - x_B^3 - 3 x_B^2 (x - x_B)), T in kelvin, x = ln(R / 1 ohm), B = (a / 100) T_B^2.
/// With C = 0 this is R = R_B exp(B (1/T - 1/T_B)); otherwise the equation of Steinhart and Hart (1968) with the coefficient C
/// of that name. The relative change at T_B is -a percent per kelvin, so `a` is entered POSITIVE for an NTC
/// (docs/references.md#e18). Against a Steinhart-Hart NTC anchored at 25 degC the B law errs by 0.01 K at 20 and 30
/// degC, 0.09 K at 40, 0.8 K at 70. 1 kOhm, a = 4.4: 924.294 ohm at 26.8 degC.
struct Thermistor {
  double resistance_at_base = 1000.0;  // R_B [ohm]
  double base_temperature = 25.0;      // T_B [degC]
  double coefficient_percent = 4.4;    // a [%/K], positive for an NTC
  double third_order = 0.0;            // C [1/K]

  [[nodiscard]] double resistance(double temperature) const;  // [ohm] at [degC]
  [[nodiscard]] double temperature(double resistance) const;  // [degC] at [ohm] > 0
};

struct ThermistorFit {
  Thermistor thermistor;
  double sigma_coefficient = 0.0;  // [%/K]; infinite for two readings
  double rms = 0.0;                // of the temperatures [K]
  double largest = 0.0;            // [K]
  /// RMS of each reading by the equation from all others [K]: of the B law and of Steinhart-Hart; infinite where too few
  /// readings are left.
  double held_out_b = 0.0, held_out_steinhart_hart = 0.0;
};

/// R_B, a, and C where Steinhart-Hart predicts the readings that it was not fitted to better than the B law does. Both are
/// linear in 1/T. `temperature` [degC], `resistance` [ohm], both N >= 2, temperatures not all equal.
ThermistorFit fit_thermistor(const Eigen::Ref<const Eigen::VectorXd>& temperature,
                             const Eigen::Ref<const Eigen::VectorXd>& resistance,
                             double base_temperature = 25.0);

}  // namespace invar::metrology
