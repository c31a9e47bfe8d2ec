#include "core/metrology/geometric/geometric_prior.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace invar::metrology {

namespace {

std::size_t index(MotionKind kind) { return static_cast<std::size_t>(kind); }

/// Correlation (1 + s + s^2/3) exp(-s), s = sqrt(5) r / length, and its derivative by log length.
struct Matern {
  double value;
  double slope;
};
Matern matern52(double distance, double length) {
  const double s = std::sqrt(5.0) * distance / length;
  const double fall = std::exp(-s);
  return {(1.0 + s + s * s / 3.0) * fall, s * s * (1.0 + s) / 3.0 * fall};
}

constexpr double nugget = 1e-7;  // of the variance: keeps long lengths well conditioned
constexpr double offset = 10.0;  // in amplitudes; the gauge takes the offset away again

}  // namespace

MotionKind kind_of(int motion) {
  if (is_rotation(motion)) return MotionKind::angle;
  return is_positioning(motion) ? MotionKind::positioning : MotionKind::straightness;
}

Strengths log_strengths(const GeometricPrior& prior) {
  Strengths logs;
  for (int k = 0; k < 3; ++k) {
    logs[k] = std::log(prior.amplitude[static_cast<std::size_t>(k)]);
    logs[3 + k] = std::log(prior.length[static_cast<std::size_t>(k)]);
  }
  logs[6] = std::log(prior.fine_amplitude[0]);
  logs[7] = std::log(prior.fine_amplitude[1]);
  logs[8] = std::log(prior.fine_length);
  for (int c = 0; c < error_motion_count; ++c)
    logs[first_relative + c] = std::log(prior.relative[static_cast<std::size_t>(c)]);
  for (int axis = 0; axis < 3; ++axis)
    logs[first_stretch + axis] = std::log(prior.stretch[static_cast<std::size_t>(axis)]);
  return logs;
}

GeometricPrior with_log_strengths(const GeometricPrior& prior, const Strengths& logs) {
  GeometricPrior result = prior;
  for (int k = 0; k < 3; ++k) {
    result.amplitude[static_cast<std::size_t>(k)] = std::exp(logs[k]);
    result.length[static_cast<std::size_t>(k)] = std::exp(logs[3 + k]);
  }
  result.fine_amplitude[0] = std::exp(logs[6]);
  result.fine_amplitude[1] = std::exp(logs[7]);
  result.fine_length = std::exp(logs[8]);
  for (int c = 0; c < error_motion_count; ++c)
    result.relative[static_cast<std::size_t>(c)] = std::exp(logs[first_relative + c]);
  for (int axis = 0; axis < 3; ++axis)
    result.stretch[static_cast<std::size_t>(axis)] = std::exp(logs[first_stretch + axis]);
  return result;
}

std::array<double, 3> expected_stretch(const std::array<Range, 3>& travel) {
  const double longest = std::max({travel[0].width(), travel[1].width(), travel[2].width()});
  std::array<double, 3> stretch{1.0, 1.0, 1.0};
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (travel[axis].width() > 0.0) stretch[axis] = std::sqrt(travel[axis].width() / longest);
  return stretch;
}

Eigen::MatrixXd coefficient_covariance(const GeometricBasis& basis, const GeometricPrior& prior, int motion) {
  const auto axis = static_cast<std::size_t>(axis_of(motion));
  const auto& spline = basis.splines[axis];
  const MotionKind kind = kind_of(motion);
  const double amplitude = prior.amplitude_of(motion);
  const double variance = amplitude * amplitude;
  const double fine = prior.fine_amplitude[index(kind)] * prior.fine_amplitude[index(kind)];
  const double width = spline.interval().width();
  const double slope =
      kind == MotionKind::positioning ? prior.positioning_slope * width : prior.angle_slope * amplitude;
  Eigen::MatrixXd covariance(spline.size(), spline.size());
  for (int i = 0; i < spline.size(); ++i) {
    for (int j = 0; j <= i; ++j) {
      const double gi = (spline.place(i) - basis.origin[axis]) / width;
      const double gj = (spline.place(j) - basis.origin[axis]) / width;
      const double distance = spline.place(i) - spline.place(j);
      double value = variance * (matern52(distance, prior.length_of(motion)).value + offset * offset) +
                     slope * slope * gi * gj;
      if (fine > 0.0) value += fine * matern52(distance, prior.fine_length).value;
      covariance(i, j) = covariance(j, i) = value;
    }
    covariance(i, i) += nugget * variance;
  }
  return covariance;
}

std::vector<CovarianceSlope> coefficient_covariance_slopes(const GeometricBasis& basis,
                                                           const GeometricPrior& prior, int motion) {
  const auto axis = static_cast<std::size_t>(axis_of(motion));
  const auto& spline = basis.splines[axis];
  const MotionKind kind = kind_of(motion);
  const int k = static_cast<int>(kind);
  const double variance = prior.amplitude_of(motion) * prior.amplitude_of(motion);
  const double fine = prior.fine_amplitude[index(kind)] * prior.fine_amplitude[index(kind)];
  GeometricPrior coarse = prior;  // only what scales with the amplitude
  coarse.fine_amplitude[index(kind)] = 0.0;
  coarse.positioning_slope = 0.0;
  std::vector<CovarianceSlope> slopes;
  slopes.push_back({{k, first_relative + motion}, 2.0 * coefficient_covariance(basis, coarse, motion)});
  const auto fill = [&](std::vector<int> strengths, auto entry) {
    Eigen::MatrixXd matrix(spline.size(), spline.size());
    for (int i = 0; i < spline.size(); ++i)
      for (int j = 0; j <= i; ++j) matrix(i, j) = matrix(j, i) = entry(spline.place(i) - spline.place(j));
    slopes.push_back({std::move(strengths), std::move(matrix)});
  };
  fill({3 + k, first_stretch + axis_of(motion)},
       [&](double d) { return variance * matern52(d, prior.length_of(motion)).slope; });
  if (kind == MotionKind::angle) return slopes;
  fill({6 + k}, [&](double d) { return 2.0 * fine * matern52(d, prior.fine_length).value; });
  fill({8}, [&](double d) { return fine * matern52(d, prior.fine_length).slope; });
  return slopes;
}

}  // namespace invar::metrology
