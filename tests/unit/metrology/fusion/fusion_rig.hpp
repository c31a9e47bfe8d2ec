// Recordings of a coarse encoder and a noisy velocity sensor whose truth is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/metrology/fusion/fusion_runs.hpp"
#include "core/metrology/fusion/sensor_identification.hpp"

namespace invar::metrology::testing {

constexpr double dt = 0.002;

/// What the sensors of a test are; the identification must find it out.
struct Rig {
  double step = 2e-3;
  double offset = 0.3e-3;  // the encoder reads this much low
  double hysteresis = 0.0;
  double compression = 0.12;  // gain 1 - compression |v|
  double lag = 0.0;
};

/// Samples `position(t)` over `duration` with both sensors; noise is uniform, of the largest reading.
template <class Position>
FusionRun record(const Rig& rig, Position position, double duration, double noise_level, unsigned seed) {
  std::mt19937 random{seed};
  std::uniform_real_distribution<double> uniform{-1.0, 1.0};
  const auto n = static_cast<Eigen::Index>(duration / dt) + 1;
  FusionRun run{Eigen::VectorXd(n),
                Eigen::VectorXd(n),
                Eigen::MatrixXd(n, 1),
                Eigen::MatrixXd(n, 1),
                Eigen::VectorXd::Constant(n, noise_level),
                {}};
  Eigen::VectorXd clean(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = dt * static_cast<double>(i);
    run.time(i) = t;
    run.reference(i) = position(t);
    const double v = (position(t - rig.lag + 1e-5) - position(t - rig.lag - 1e-5)) / 2e-5;
    const double way = v > 0.0 ? 1.0 : -1.0;
    run.positions(i, 0) = rig.step * std::round((position(t) - rig.offset - way * rig.hysteresis) / rig.step);
    clean(i) = v * (1.0 - rig.compression * std::abs(v));
  }
  const double largest = clean.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < n; ++i)
    run.velocities(i, 0) = clean(i) + noise_level * largest * uniform(random);
  return run;
}

/// From rest to constant speed with 2 m/s2.
inline auto constant_speed(double speed) {
  return [speed](double t) {
    const double ramp = speed / 2.0;
    if (t <= 0.0) return 0.0;
    return t < ramp ? t * t : speed * (t - 0.5 * ramp);
  };
}
inline auto sinusoid(double period) {
  return [period](double t) {
    return t <= 0.0 ? 0.0 : 0.1 * (1.0 - std::cos(2.0 * std::numbers::pi * t / period));
  };
}

inline std::vector<FusionRun> training(const Rig& rig, bool both_ways = false) {
  std::vector<FusionRun> runs;
  unsigned seed = 1;
  for (const double noise : {0.05, 0.2, 1.0})
    for (const double speed : {0.02, 0.04, 0.1, 0.2, 0.4, 0.6}) {
      const double duration = std::min(2.0, 0.2 / speed);
      if (both_ways) {
        const auto forth = constant_speed(speed);
        runs.push_back(record(
            rig, [&](double t) { return t < duration ? forth(t) : forth(duration) - forth(t - duration); },
            2.0 * duration, noise, seed++));
      } else {
        runs.push_back(record(rig, constant_speed(speed), duration, noise, seed++));
      }
    }
  return runs;
}

inline double rms(FusionEstimator& estimator, const FusionRun& run, Eigen::Index from = 0) {
  const auto fused = fuse(estimator, run);
  double squares = 0.0;
  for (Eigen::Index i = from; i < run.time.size(); ++i)
    squares += std::pow(fused[static_cast<std::size_t>(i)].position - run.reference(i), 2);
  return std::sqrt(squares / static_cast<double>(run.time.size() - from));
}

inline double encoder_rms(const FusionRun& run, Eigen::Index from = 0) {
  return std::sqrt((run.positions.col(0) - run.reference).tail(run.time.size() - from).squaredNorm() /
                   static_cast<double>(run.time.size() - from));
}

inline FusionModel model_of(const Rig& rig) {
  return identify_sensors(training(rig), {"encoder"}, {"speed"}, nullptr);
}

/// Moves and rests in turn: half a sinusoid, then a pause where it turned.
inline auto with_rests(double period, double rest) {
  return [=](double t) {
    const double half = 0.5 * period, whole = half + rest;
    const double k = std::floor(t / whole), in = std::min(t - k * whole, half);
    const double way = 0.05 * (1.0 - std::cos(2.0 * std::numbers::pi * in / period));
    return t <= 0.0 ? 0.0 : (std::fmod(k, 2.0) == 0.0 ? way : 0.1 - way);
  };
}

}  // namespace invar::metrology::testing
