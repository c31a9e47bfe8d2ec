// Identification of the thermal error from readings over position, temperature and heating rate.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/thermal/thermal_error.hpp"

namespace invar::metrology {

/// N readings: position [m], temperature [degC], error [m]; where measured the heating rate [K/s], the
/// direction of travel (+1, -1) and the time [s, ascending]. All finite.
struct ThermalReadings {
  Eigen::VectorXd x;
  Eigen::VectorXd temperature;
  Eigen::VectorXd error;
  std::optional<Eigen::VectorXd> heating_rate;
  std::optional<Eigen::VectorXd> direction;
  std::optional<Eigen::VectorXd> time;
  /// Temperatures of further thermistors [degC], at most most_zones.
  struct Zone {
    std::string name;
    Eigen::VectorXd temperature;
  };
  std::vector<Zone> zones;
  /// Course of the temperature, also while nothing was read: for a lagged temperature. Ascending; empty: what the readings say.
  struct History {
    std::vector<double> time;         // [s]
    std::vector<double> temperature;  // [degC]
  };
  History history{};
  std::size_t incomplete = 0;  // rows of the recording that lacked a value and are not here

  /// The temperature of a body behind the sensor at each reading [degC]. Needs `time`; `lag` [s] > 0.
  [[nodiscard]] Eigen::VectorXd lagged(double lag) const;
};

/// A model that was tried, in the order of trial.
struct ThermalCandidate {
  std::string name;
  double log_evidence = 0.0;  // log p(readings | model), hyperparameters at their best
  double left_out_rms = 0.0;  // RMS of reading minus prediction without it [m]
  double held_out_rms = 0.0;  // RMS of reading minus prediction without its pass and every fifth other [m]
  double lag = 0.0;           // [s], of the lag-state model
  bool chosen = false;
  std::string verdict;  // why it was or was not taken
};

struct ThermalFit {
  ThermalError model;
  std::vector<ThermalCandidate> candidates;
  Eigen::VectorXd predicted;      // of each reading, its direction included [m]
  Eigen::VectorXd kept;           // 1, or 0 for a reading that stands alone as an outlier
  Eigen::Index in_stretches = 0;  // readings far from the model in stretches: they are kept
  double reversal = 0.0;          // mean of forward minus backward [m]
  std::vector<std::string> unidentified;
  std::vector<std::string> unexplained;  // what no term here explains, sentences
  std::vector<std::string> notes;        // what else the user should know, sentences
};

/// e(x, T, r) = g(x) + tau a(x) + surface(x, tau) [+ rate terms] [+ direction b(x)]. Every function has a
/// Matern prior; evidence sets its size and length (docs/explanation/thermal.md#model). Terms of further
/// zones' temperatures, a lagged temperature, the heating rate and hysteresis are tried in turn. A term is kept where the log
/// evidence rises by more than three and passes that were not fitted are met no worse. Outliers (4.5 standard deviations) are rejected,
/// stretches of them are not. At least four readings at two
/// positions.
ThermalFit identify_thermal(const ThermalReadings& readings);

}  // namespace invar::metrology
