#include "core/metrology/droplet/trajectory_tracker.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

double known(double sigma) { return std::isfinite(sigma) ? sigma * sigma : 0.0; }

}  // namespace

TrajectoryTracker::TrajectoryTracker(const TrajectoryFit& fit, const TrajectoryDrift& drift)
    : drift_{drift},
      begun_{fit.trajectory},
      now_{fit.trajectory},
      scatter_at_nozzle_{fit.scatter_at_nozzle},
      scatter_per_height_{fit.scatter_per_height} {
  state_ << begun_.placement, begun_.slope, begun_.delay, begun_.slowness;
  for (int k = 0; k < 2; ++k) {
    covariance_(k, k) = begun_.covariance(0, 0);
    covariance_(k, 2 + k) = covariance_(2 + k, k) = begun_.covariance(0, 1);
    covariance_(2 + k, 2 + k) = begun_.covariance(1, 1);
  }
  covariance_(4, 4) = known(begun_.delay_sigma);
  covariance_(5, 5) = known(begun_.slowness_sigma);
}

bool TrajectoryTracker::add(double time, double height, const Eigen::Vector2d& stage_velocity,
                            const Eigen::Vector2d& offset) {
  INVAR_EXPECTS(time >= time_, time, time_);
  const double seconds = time - time_;
  time_ = time;
  const double slowness = drift_.slowness * begun_.slowness;
  for (int k = 0; k < 2; ++k) covariance_(k, k) += drift_.placement * drift_.placement * seconds;
  covariance_(5, 5) += slowness * slowness * seconds;

  Eigen::Matrix<double, 2, 6> row = Eigen::Matrix<double, 2, 6>::Zero();
  for (int k = 0; k < 2; ++k) {
    row(k, k) = 1.0;
    row(k, 2 + k) = height;
    row(k, 4) = stage_velocity(k);
    row(k, 5) = height * stage_velocity(k);
  }
  const double scatter = std::hypot(scatter_at_nozzle_, scatter_per_height_ * height);
  const Eigen::Matrix2d expected =
      row * covariance_ * row.transpose() + scatter * scatter * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d inverse = expected.inverse();
  const Eigen::Vector2d surprise = offset - row * state_;
  constexpr double gate = 4.0;
  if (!(surprise.dot(inverse * surprise) <= gate * gate)) return false;
  const Eigen::Matrix<double, 6, 2> gain = covariance_ * row.transpose() * inverse;
  state_ += gain * surprise;
  covariance_ = (Covariance::Identity() - gain * row) * covariance_;
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();

  now_.placement = state_.head<2>();
  now_.slope = state_.segment<2>(2);
  now_.delay = state_(4);
  now_.slowness = std::max(state_(5), 0.0);
  now_.covariance << covariance_(0, 0), covariance_(0, 2), covariance_(2, 0), covariance_(2, 2);
  if (std::isfinite(begun_.delay_sigma)) now_.delay_sigma = std::sqrt(covariance_(4, 4));
  if (std::isfinite(begun_.slowness_sigma)) now_.slowness_sigma = std::sqrt(covariance_(5, 5));
  return true;
}

double TrajectoryTracker::change(double height, const Eigen::Vector2d& stage_velocity) const {
  return (now_.offset(height, stage_velocity) - begun_.offset(height, stage_velocity)).norm();
}

}  // namespace invar::metrology
