#include "core/metrology/fusion/fusion_runs.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/numerics/decompositions.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

/// Velocity and acceleration of the reference: a parabola through five rows around each.
Motion motion_of(const FusionRun& run) {
  const Eigen::Index n = run.time.size();
  Motion motion{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index from = std::clamp<Eigen::Index>(i - 2, 0, std::max<Eigen::Index>(0, n - 5));
    const Eigen::Index count = std::min<Eigen::Index>(5, n - from);
    if (count < 3) continue;
    const double span = run.time(from + count - 1) - run.time(from);
    Eigen::Matrix3d gram = Eigen::Matrix3d::Zero();
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    for (Eigen::Index k = from; k < from + count; ++k) {
      const double s = (run.time(k) - run.time(i)) / span;
      const Eigen::Vector3d row{1.0, s, s * s};
      gram += row * row.transpose();
      moment += row * (run.reference(k) - run.reference(i));
    }
    const Eigen::Vector3d p = numerics::solve_symmetric(gram, moment);
    motion.velocity(i) = p(1) / span;
    motion.acceleration(i) = 2.0 * p(2) / (span * span);
  }
  return motion;
}

double rms_error(const std::vector<FusedPosition>& fused, const FusionRun& run) {
  double squares = 0.0;
  for (Eigen::Index i = 0; i < run.time.size(); ++i)
    squares += std::pow(fused[static_cast<std::size_t>(i)].position - run.reference(i), 2);
  return std::sqrt(squares / static_cast<double>(run.time.size()));
}

/// Positions of all sensors, velocities integrated from the first position reading (trapezoids).
Eigen::MatrixXd integrated(const FusionRun& run) {
  const Eigen::Index n = run.time.size();
  const Eigen::Index p = run.positions.cols();
  Eigen::MatrixXd all(n, p + run.velocities.cols());
  all.leftCols(p) = run.positions;
  double begin = 0.0;
  for (Eigen::Index i = 0; i < n; ++i)
    if (std::isfinite(run.positions(i, 0))) {
      begin = run.positions(i, 0);
      break;
    }
  for (Eigen::Index k = 0; k < run.velocities.cols(); ++k) {
    double x = begin;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i > 0) {
        const double step =
            0.5 * (run.velocities(i, k) + run.velocities(i - 1, k)) * (run.time(i) - run.time(i - 1));
        if (std::isfinite(step)) x += step;
      }
      all(i, p + k) = x;
    }
  }
  return all;
}

double typical_speed(const Motion& motion) {
  const Eigen::VectorXd speed = motion.velocity.cwiseAbs();
  return numerics::median({speed.begin(), speed.end()});
}

double run_noise(const FusionRun& run) {
  if (run.noise_level.size() > 0 && std::isfinite(run.noise_level(0))) return run.noise_level.mean();
  return run.velocities.cols() > 0 ? estimated_noise_level(run.velocities.col(0)) : 0.0;
}

/// Rows where every sensor reads.
std::vector<Eigen::Index> complete_rows(const Eigen::MatrixXd& sensors) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < sensors.rows(); ++i)
    if (sensors.row(i).allFinite()) rows.push_back(i);
  return rows;
}

double estimated_noise_level(const Eigen::Ref<const Eigen::VectorXd>& velocity) {
  std::vector<double> second;
  for (Eigen::Index i = 2; i < velocity.size(); ++i) {
    const double d = velocity(i) - 2.0 * velocity(i - 1) + velocity(i - 2);
    if (std::isfinite(d)) second.push_back(d);
  }
  if (second.size() < 8) return 0.0;
  const double noise = numerics::robust_deviation(second, 0.0) / std::sqrt(6.0) * std::sqrt(3.0);
  // The largest reading of the motion: of averages long enough that the noise hardly adds to it.
  const Eigen::Index block = std::max<Eigen::Index>(20, velocity.size() / 40);
  double largest = 0.0;
  for (Eigen::Index i = 0; i + block <= velocity.size(); i += block / 2) {
    const double mean = velocity.segment(i, block).mean();
    if (std::isfinite(mean)) largest = std::max(largest, std::abs(mean));
  }
  return largest > 0.0 ? noise / largest : 0.0;
}

std::vector<FusedPosition> fuse(FusionEstimator& estimator, const FusionRun& run) {
  estimator.reset();
  std::vector<FusedPosition> fused;
  fused.reserve(static_cast<std::size_t>(run.time.size()));
  FusionSample sample;
  for (Eigen::Index i = 0; i < run.time.size(); ++i) {
    sample.period = i > 0 ? run.time(i) - run.time(i - 1) : 0.0;
    for (Eigen::Index k = 0; k < run.positions.cols(); ++k)
      sample.positions[static_cast<std::size_t>(k)] = run.positions(i, k);
    for (Eigen::Index k = 0; k < run.velocities.cols(); ++k)
      sample.velocities[static_cast<std::size_t>(k)] = run.velocities(i, k);
    if (run.noise_level.size() > 0) sample.noise_level = run.noise_level(i);
    if (run.selector.size() > 0) sample.selector = run.selector(i);
    fused.push_back(estimator.step(sample));
  }
  return fused;
}

}  // namespace invar::metrology
