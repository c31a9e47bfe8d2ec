// Error motions that were measured themselves, at several states of the machine, as networks.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/metrology/geometric/error_motion_networks.hpp"

namespace invar::metrology {

/// Readings of one error motion.
struct ErrorMotionReadings {
  Eigen::VectorXd position;         // N [m], of the moving axis
  Eigen::MatrixXd state;            // states of the machine x N
  Eigen::VectorXd value;            // N, m or rad
  std::vector<int> direction = {};  // N, +1 or -1, of the motion; empty where not told
};

/// An error motion's network and how it was chosen.
struct ErrorMotionFit {
  ErrorMotionNetwork motion;
  double left_out = 0.0;       // RMS of readings that the fit did not have, m or rad
  double over_position = 0.0;  // the same with the position alone
  double noise = 0.0;          // of one reading, about the fit
  std::size_t rejected = 0;    // readings further off than five robust deviations
  std::vector<bool> kept;      // N
  std::vector<double> rest;    // N, reading minus fit, m or rad
};

/// Least number of readings of an error motion.
inline constexpr Eigen::Index least_error_motion_readings = 8;

/// A network over the position by ridge regression (GCV). A state of the machine becomes a further input where that meets
/// left-out readings better by more than two standard errors, the best such state first. Readings at one position and state
/// (within a twentieth of its range) are averaged. Needs `least_error_motion_readings`, finite. Set-up only.
ErrorMotionFit identify_error_motion(const ErrorMotionReadings& readings);

/// Readings as the mean of both directions would be: half the reversal is taken from each.
ErrorMotionReadings without_reversal(ErrorMotionReadings readings, const ReversalCurve& reversal);

}  // namespace invar::metrology
