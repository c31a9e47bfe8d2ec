// Sensor fusion: one position from several position and velocity sensors; two estimators, one interface.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace invar::metrology {

constexpr std::size_t most_sensors = 8;  // of each kind

/// What the sensors read in one period; NaN where a reading is missing.
struct FusionSample {
  double period = 0.0;                            // since the last sample [s]; 0 for the first
  std::array<double, most_sensors> positions{};   // [m]
  std::array<double, most_sensors> velocities{};  // [m/s]
  double noise_level = std::numeric_limits<double>::quiet_NaN();  // of the largest reading; NaN: unknown
};

/// The fused position and what each sensor contributed: `weights` sum to one over those that live, positions
/// first, then velocities.
struct FusedPosition {
  double position = 0.0;  // [m]
  double velocity = 0.0;  // [m/s]
  double sigma = 0.0;     // of the position [m]; infinite where nothing is known
  std::array<double, 2 * most_sensors> weights{};
  unsigned live = 0;  // bit i: sensor i (same order) is trusted
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
  double step = 0.0;        // [m]
  double offset = 0.0;      // [m]
  double hysteresis = 0.0;  // half the difference between directions [m]
  double delay = 0.0;       // [s]
  double noise = 0.0;       // of an edge, or of a continuous reading [m]
  int longest_repeat = 0;   // how often in a row a sound continuous sensor repeated its reading
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

/// The structured estimator: an interacting multiple model Kalman filter over position, velocity,
/// acceleration and the gain of the first velocity sensor. A quantised reading is the certainty that the
/// position lies in its cell, so every edge is an absolute fix; the cell's likelihood is applied by its exact
/// first two moments. Noise of the velocity sensors is estimated from their second differences. A sensor that
/// repeats itself, contradicts the others or is missing loses its weight and gets it back when it agrees again.
/// Source: metrology.md section 10 (interval observer and its Kalman version).
class FusionObserver final : public FusionEstimator {
 public:
  explicit FusionObserver(const FusionModel& model);
  void reset() noexcept override;
  FusedPosition step(const FusionSample& sample) noexcept override;

 private:
  static constexpr int models = 3;
  using State = Eigen::Vector4d;
  using Covariance = Eigen::Matrix4d;
  struct Mode {
    State mean;
    Covariance covariance;
    double probability;
  };
  struct PositionMemory {
    double last = std::numeric_limits<double>::quiet_NaN();
    double conflict = 0.0;  // cumulated surprise while the reading stands still
    double pulled = 0.0;    // what its cell moved the estimate by since then [m]
    double travel = 0.0;    // that the velocity sensors report since the reading last changed [m]
    double travel_variance = 0.0;
    double believed = 0.0;  // the last reading that was no surprise [m]
    double since = 0.0;     // travel by the velocity sensors since then [m]
    double since_variance = 0.0;
    std::array<double, most_sensors> others{};  // readings of all when this one last changed
    int repeats = 0;
    int odd = 0;   // surprising readings in a row
    int good = 0;  // unsurprising ones in a row
    bool faulty = false;
  };
  struct VelocityMemory {
    std::array<double, 2> last{};
    int seen = 0;
    int repeats = 0;
    int odd = 0;
    int good = 0;
    bool faulty = false;
    bool dead = false;      // repeats itself, which a sound one does not
    double variance = 0.0;  // of one reading [m2/s2]
    double weight = 0.0;    // of the average behind it, in samples
    double largest = 0.0;   // reading so far
  };

  void start(const FusionSample& sample) noexcept;
  void mix() noexcept;
  void predict(double dt) noexcept;
  void learn_noise(const FusionSample& sample) noexcept;
  void use_velocity(std::size_t i, double reading) noexcept;
  void use_position(std::size_t i, double reading) noexcept;
  void add_travel(const FusionSample& sample) noexcept;
  [[nodiscard]] bool refuted_standing(std::size_t position) const noexcept;
  [[nodiscard]] bool refuted_jump(std::size_t position, double reading) const noexcept;
  void watch_for_dead(const FusionSample& sample) noexcept;
  [[nodiscard]] bool outlived(std::size_t still, std::size_t moving, double reading) const noexcept;
  void undo(std::size_t steps) noexcept;
  void advance(double period) noexcept;
  void restart_at(const PositionSensorModel& sensor, double reading) noexcept;
  [[nodiscard]] bool alone(std::size_t position) const noexcept;
  void renormalise(const std::array<double, models>& likelihood) noexcept;
  [[nodiscard]] State mean() const noexcept;

  FusionModel model_;
  std::array<Mode, models> modes_{};
  static constexpr std::size_t history = 16;
  struct Past {
    std::array<Mode, models> modes;  // as predicted for the sample, before its readings
    FusionSample sample;
  };
  std::array<Past, history> past_{};  // a ring
  std::size_t steps_ = 0;             // samples since the reset
  std::array<PositionMemory, most_sensors> position_memory_{};
  std::array<VelocityMemory, most_sensors> velocity_memory_{};
  std::array<double, 2 * most_sensors> information_{};
  double switching_ = 0.0;  // probability of a change of mode in this period
  bool started_ = false;
};

}  // namespace invar::metrology
