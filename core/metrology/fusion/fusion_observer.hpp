// FusionObserver: sensors of known structure fused by it - edges as absolute fixes, drift of the sensors as states.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>

#include "core/metrology/fusion/sensor_fusion.hpp"

namespace invar::metrology {

/// The structured estimator: an interacting multiple model Kalman filter over position, velocity and acceleration.
/// Its further states drift while the sensors work: gain, offset and lag of each velocity sensor, offset and delay of
/// each position sensor but the first, which is the reference. A quantised reading is the certainty that the position
/// lies in its cell. Every edge is therefore an absolute fix; the cell's likelihood is applied by its exact first two
/// moments. An encoder that counts on edge by edge, without an unexplained leap, overrides any velocity sensor. The
/// estimate is then reset to the encoder, and the gains are identified anew. Noise of the velocity sensors is estimated
/// from their second differences. A sensor that repeats itself, contradicts the others or is missing loses its weight,
/// and gets it back when it agrees again. The loss takes one period for a missing or jumping reading. For a continuous
/// sensor that dies it takes four repetitions more than ever before; for an encoder that sticks, the way of two cells.
/// A second estimate runs without the readings that stand still. As these become improbable by that estimate, the fused
/// position goes over to it, and sigma holds the distance of both. An encoder that stood still while the others moved
/// comes back only after it has counted again: the true position may pass the stuck one.
/// Source: docs/explanation/fusion.md#interval-observer; Blom and Bar-Shalom 1988.
class FusionObserver final : public FusionEstimator {
 public:
  explicit FusionObserver(const FusionModel& model);
  void reset() noexcept override;
  FusedPosition step(const FusionSample& sample) noexcept override;

 private:
  static constexpr int models = 3;
  static constexpr double most_doubt =
      0.5;  // a velocity sensor is believed that the axis moves, if not how far
  static constexpr int most_states = 3 + 3 * static_cast<int>(most_sensors);
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_states, 1>;
  using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_states, most_states>;
  struct Mode {
    State mean;
    Covariance covariance;
    double probability;
  };
  using Estimate = std::array<Mode, models>;
  /// A reading's dependence on the state: the few entries that are not zero.
  struct Row {
    std::array<Eigen::Index, 6> at{};
    std::array<double, 6> value{};
    int size = 0;
    void add(Eigen::Index where, double what) noexcept {
      at[static_cast<std::size_t>(size)] = where;
      value[static_cast<std::size_t>(size++)] = what;
    }
    [[nodiscard]] double dot(const State& state) const noexcept;
    [[nodiscard]] State times(const Covariance& covariance) const noexcept;  // covariance . row
  };
  /// Evidence of a reading about an estimate: how the distribution of the quantity that it measures changes, mode by mode.
  struct Reading {
    std::array<State, models> gains;      // covariance . row
    std::array<double, models> before{};  // variance of the quantity by the estimate
    std::array<double, models> shift{};   // of its mean
    std::array<double, models> keep{};    // part of its variance that is left
    std::array<double, models> likelihood{};
    /// Probability of such a reading or an odder one; of a cell over the most that a cell of its size can hold.
    double probability = 0.0;
  };
  struct PositionMemory {
    double last = std::numeric_limits<double>::quiet_NaN();
    double conflict = 0.0;  // cumulated surprise while the reading stands still
    double travel = 0.0;    // that the velocity sensors report since the reading last changed [m]
    double travel_variance = 0.0;
    double leapt = 0.0;  // changes of the reading that no motion explains, since it was last believed [m]
    double from = 0.0;   // reading when it last was doubted, or leapt [m]
    std::array<double, most_sensors> others{};  // readings of all when this one last changed
    int repeats = 0;
    int odd = 0;   // surprising readings in a row
    int good = 0;  // unsurprising ones in a row
    bool faulty = false;
    bool left = false;    // it stood still while others moved, and has not counted since
    double unheld = 1.0;  // probability of its reading by the estimate that no standing reading holds
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
    double unread = 0.0;    // time since it was last read [s]
  };

  void start(const FusionSample& sample) noexcept;
  void mix(Estimate& modes) const noexcept;
  void predict(Estimate& modes, double dt) const noexcept;
  void learn_noise(const FusionSample& sample) noexcept;
  void use_velocity(std::size_t i, const FusionSample& sample) noexcept;
  void use_position(std::size_t i, const FusionSample& sample) noexcept;
  [[nodiscard]] Reading velocity_reading(const Estimate& modes, std::size_t i,
                                         const FusionSample& sample) const noexcept;
  [[nodiscard]] Reading position_reading(const Estimate& modes, std::size_t i,
                                         const FusionSample& sample) const noexcept;
  static double take(Estimate& modes, const Reading& reading) noexcept;
  void add_travel(const FusionSample& sample) noexcept;
  [[nodiscard]] bool travelled_on(std::size_t position) const noexcept;
  [[nodiscard]] bool stood_still(std::size_t position, const FusionSample& sample) const noexcept;
  [[nodiscard]] bool refuted_standing(std::size_t position, double reading) const noexcept;
  [[nodiscard]] bool left_behind(std::size_t position, double reading) const noexcept;
  [[nodiscard]] bool refuted_jump(std::size_t position) const noexcept;
  [[nodiscard]] bool counts_on(std::size_t position, double reading) const noexcept;
  [[nodiscard]] bool counts_again(std::size_t position, double reading) noexcept;
  void see_change(std::size_t position, double reading, double time) noexcept;
  [[nodiscard]] bool witnessed() const noexcept;
  [[nodiscard]] bool only_position(std::size_t position) const noexcept;
  void watch_for_dead(const FusionSample& sample) noexcept;
  [[nodiscard]] bool outlived(std::size_t still, std::size_t moving, double reading) const noexcept;
  void undo(std::size_t steps) noexcept;
  void advance(double period) noexcept;
  void leave(std::size_t position, double reading) noexcept;
  void settle() noexcept;
  [[nodiscard]] double unheld_weight() const noexcept;
  void restart(std::size_t position, double reading) noexcept;
  void restart_at(std::size_t position, double reading) noexcept;
  [[nodiscard]] bool alone(std::size_t position) const noexcept;
  static void renormalise(Estimate& modes, const std::array<double, models>& likelihood) noexcept;
  [[nodiscard]] State mean(const Estimate& modes) const noexcept;
  [[nodiscard]] static double variance(const Estimate& modes, double about) noexcept;
  [[nodiscard]] bool silent(const FusionSample& sample, std::size_t sensor) const noexcept {
    return (sample.silent >> sensor & 1U) != 0U;
  }
  // Where the drifting properties of a sensor stand in the state.
  [[nodiscard]] Eigen::Index offset_of_position(std::size_t i) const noexcept {
    return 3 + 2 * static_cast<Eigen::Index>(i - 1);
  }
  [[nodiscard]] Eigen::Index gain_of_velocity(std::size_t i) const noexcept {
    return 3 + 2 * static_cast<Eigen::Index>(model_.positions.size() - 1) + 3 * static_cast<Eigen::Index>(i);
  }
  /// How late a sensor's reading is: its own delay, as far as known by now, and its age [s].
  [[nodiscard]] double position_delay(std::size_t i, const State& state) const noexcept;
  [[nodiscard]] double velocity_lag(std::size_t i, const State& state) const noexcept;

  FusionModel model_;
  std::size_t positions_, velocities_;
  Eigen::Index states_;
  State drift_;  // spectral density of each drifting property
  Estimate modes_{};
  /// The estimate by all but the readings that stand still, since those were last beyond doubt. A stuck sensor is tested
  /// against this estimate, and the fusion goes on with it.
  Estimate unheld_{};
  double settled_at_ = 0.0;  // position when it last was set [m]
  double doubt_ = 0.0;       // by how much, relative, the travel that the velocity sensors tell may be wrong
  static constexpr std::size_t history = 16;
  struct Past {
    Estimate modes;  // as predicted for the sample, before its readings
    FusionSample sample;
  };
  std::array<Past, history> past_{};  // a ring
  std::size_t steps_ = 0;             // samples since the reset
  std::array<PositionMemory, most_sensors> position_memory_{};
  std::array<VelocityMemory, most_sensors> velocity_memory_{};
  std::array<double, most_sensors> information_{};  // positions first, then velocities
  double switching_ = 0.0;                          // probability of a change of mode in this period
  bool started_ = false;
};

}  // namespace invar::metrology
