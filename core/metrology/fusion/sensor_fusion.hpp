// Sensor fusion: one position from several position and velocity sensors; what every estimator takes and gives.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace invar::metrology {

constexpr std::size_t most_sensors = 8;  // of all kinds together

/// Readings of the sensors in one period; NaN where a reading is missing.
struct FusionSample {
  double period = 0.0;                            // since the last sample [s]; 0 for the first
  std::array<double, most_sensors> positions{};   // [m]
  std::array<double, most_sensors> velocities{};  // [m/s]
  double noise_level = std::numeric_limits<double>::quiet_NaN();  // of the largest reading; NaN: unknown
  double selector = 0.0;  // a further attribute, where the weights depend on one
  /// Where an instrument beside the sensors says the axis is [m]; NaN: there is none. Only who learns looks at it.
  double reference = std::numeric_limits<double>::quiet_NaN();
  /// How long ago each was read (positions first, then velocities): known from stamps, beside what the sensor's own delay is
  /// [s].
  std::array<double, most_sensors> ages{};
  /// Bit i: sensor i was not asked in this period, so its silence says nothing against it.
  unsigned silent = 0;
};

/// The fused position and what each sensor contributed: `weights` sum to one over those that live, positions
/// first, then velocities.
struct FusedPosition {
  double position = 0.0;  // [m]
  double velocity = 0.0;  // [m/s]
  double sigma = 0.0;     // of the position [m]; infinite where nothing is known
  std::array<double, most_sensors> weights{};
  std::array<double, most_sensors> lateness{};  // as estimated now [s]
  std::array<double, most_sensors> noise{};     // of velocity sensors, as estimated now [m/s]
  unsigned live = 0;                            // bit i: sensor i (same order) is trusted
};

/// Real-time: `step` neither allocates nor throws. A run begins at rest with `reset`.
class FusionEstimator {
 public:
  FusionEstimator() = default;
  FusionEstimator(const FusionEstimator&) = default;
  FusionEstimator& operator=(const FusionEstimator&) = default;
  virtual ~FusionEstimator() = default;
  virtual void reset() noexcept = 0;
  virtual FusedPosition step(const FusionSample& sample) noexcept = 0;
};

/// A position sensor as calibration finds it: it reads the cell (of size `step`, 0: continuous) that holds
/// x(t - delay) - offset - hysteresis * sign(v).
struct PositionSensorModel {
  double step = 0.0;          // [m]
  double offset = 0.0;        // [m]
  double hysteresis = 0.0;    // half the difference between directions [m]
  double delay = 0.0;         // [s]
  double noise = 0.0;         // of an edge, or of a continuous reading [m]
  int longest_repeat = 0;     // how often in a row a sound continuous sensor repeated its reading
  double delay_sigma = 5e-4;  // how well the delay is known [s]
};

/// A velocity sensor: reads offset + f(v(t - lag)) + noise, f(v) = sum_k gains[k] sign(v) |v|^(k+1): a gain that
/// falls with speed.
struct VelocitySensorModel {
  std::array<double, 4> gains{1.0, 0.0, 0.0, 0.0};
  double offset = 0.0;       // [m/s]
  double lag = 0.0;          // [s]
  double fastest = 1.0;      // speed up to which f was identified [m/s]; linear beyond
  double largest = 1.0;      // typical largest reading of a run, to which noise levels refer [m/s]
  double correlation = 1.0;  // how much more the noise counts when integrated than its differences say
  int longest_repeat = 0;    // how often in a row a sound sensor repeated its reading
  double gain_sigma = 5e-3;  // how well the gain is known, relative
  double gain_drift =
      1e-4;  // what the gain wanders in a second, relative (with speed, too, where nobody measured it)
  double lag_sigma = 5e-4;  // how well the lag is known [s]

  [[nodiscard]] double response(double v) const noexcept;
  [[nodiscard]] double sensitivity(double v) const noexcept;  // df/dv
};

struct FusionModel {
  std::vector<std::string> position_names;
  std::vector<std::string> velocity_names;
  std::vector<PositionSensorModel> positions;
  std::vector<VelocitySensorModel> velocities;
  double start_offset = 0.0;  // where a run begins, relative to the first position reading [m]
  double start_sigma = 0.0;   // [m]
};

}  // namespace invar::metrology
