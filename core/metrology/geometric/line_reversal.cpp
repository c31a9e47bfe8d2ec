// The reversal of a line over its places: which the repeats can tell, and the regressors that follow it.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/metrology/geometric/line_fit.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/numerics/gaussian_prior.hpp"

namespace invar::metrology {

namespace {

constexpr double wave = 1.0 / 3.0;  // of the line, over which a reversal changes as a rule
constexpr double rough = 0.05;      // of its variance: what is each place's own
constexpr int repeated_readings =
    3;  // readings beyond the first of their points, for each place of the reversal

double along(const LineFit& work, int row) {
  return work.beam.direction.dot(work.line->readings[static_cast<std::size_t>(row)].position -
                                 work.beam.start);
}

/// Places of the points that were read both ways, in their order.
std::vector<double> both_ways(const LineFit& work) {
  std::vector<int> seen(work.first_row.size(), 0);
  for (int i = 0; i < work.rows(); ++i)
    seen[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])] |=
        work.line->readings[static_cast<std::size_t>(i)].direction > 0 ? 1 : 2;
  std::vector<double> places;
  for (std::size_t j = 0; j < seen.size(); ++j)
    if (seen[j] == 3) places.push_back(along(work, work.first_row[j]));
  std::sort(places.begin(), places.end());
  return places;
}

}  // namespace

Eigen::MatrixXd reversal_rows(const LineFit& work) {
  const auto& places = work.reversal_places;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(work.rows(), static_cast<Eigen::Index>(places.size()));
  for (int i = 0; i < work.rows() && !places.empty(); ++i) {
    const double half = 0.5 * work.line->readings[static_cast<std::size_t>(i)].direction;
    const double at = std::clamp(along(work, i), places.front(), places.back());
    const auto next = std::upper_bound(places.begin() + 1, places.end(), at);
    if (places.size() < 2) {
      rows(i, 0) = half;
      continue;
    }
    const auto above = std::min(next - places.begin(), static_cast<std::ptrdiff_t>(places.size()) - 1);
    const double lower = places[static_cast<std::size_t>(above) - 1];
    const double part = (at - lower) / (places[static_cast<std::size_t>(above)] - lower);
    rows(i, above - 1) = half * (1.0 - part);
    rows(i, above) = half * part;
  }
  return rows;
}

void add_reversal(LineFit& work) {
  work.first_shape = static_cast<int>(work.regressors.cols());
  const std::vector<double> all = both_ways(work);
  if (all.empty()) return;
  const int told = std::clamp((work.rows() - work.points()) / repeated_readings, 1, most_reversal_places);
  const int count = std::min(told, static_cast<int>(all.size()));
  if (count < 2) {
    work.reversal_places = {all[all.size() / 2]};
    return;
  }
  for (int i = 0; i < count; ++i)
    work.reversal_places.push_back(all[static_cast<std::size_t>(
        std::lround(static_cast<double>(i) * static_cast<double>(all.size() - 1) / (count - 1)))]);
  Eigen::MatrixXd covariance(count, count);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j)
      covariance(i, j) = (i == j ? rough : 0.0) +
                         numerics::matern52(std::abs(work.reversal_places[static_cast<std::size_t>(i)] -
                                                     work.reversal_places[static_cast<std::size_t>(j)]),
                                            wave * work.beam.length);
  const auto modes = numerics::symmetric_eigen(covariance);
  work.reversal_shape = modes.vectors * modes.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  work.regressors.conservativeResize(Eigen::NoChange, work.first_shape + count);
  work.regressors.rightCols(count) = reversal_rows(work) * work.reversal_shape;
}

}  // namespace invar::metrology
