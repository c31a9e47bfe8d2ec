// The thermistor equation of the seed, (3.3), with erratum E18, and its calibration.
#pragma once

#include <Eigen/Core>

namespace invar::metrology {

/// R = R_B exp((a / 100) T_B^2 (1/T - 1/T_B)), T in kelvin: the B-parameter law with B = a T_B^2 / 100. The
/// relative change at T_B is -a percent per kelvin, so `a` is entered POSITIVE for an NTC (erratum E18): with
/// the data sheet's negative sign the resistance would rise. Against a Steinhart-Hart NTC anchored at 25 degC
/// it errs by 0.01 K at 20 and 30 degC, 0.09 K at 40, 0.8 K at 70. 1 kOhm, a = 4.4: 924.294 ohm at 26.8 degC.
struct Thermistor {
  double resistance_at_base = 1000.0;  // R_B [ohm]
  double base_temperature = 25.0;      // T_B [degC]
  double coefficient_percent = 4.4;    // a [%/K], positive for an NTC

  [[nodiscard]] double resistance(double temperature) const;  // [ohm] at [degC]
  [[nodiscard]] double temperature(double resistance) const;  // [degC] at [ohm] > 0
};

struct ThermistorFit {
  Thermistor thermistor;
  double sigma_coefficient = 0.0;  // [%/K]; infinite for two readings
  double rms = 0.0;                // of the temperatures [K]
};

/// R_B and a from readings at two temperatures or more: ln R is linear in 1/T. `temperature` [degC],
/// `resistance` [ohm], both N >= 2, temperatures not all equal.
ThermistorFit fit_thermistor(const Eigen::Ref<const Eigen::VectorXd>& temperature,
                             const Eigen::Ref<const Eigen::VectorXd>& resistance,
                             double base_temperature = 25.0);

}  // namespace invar::metrology
