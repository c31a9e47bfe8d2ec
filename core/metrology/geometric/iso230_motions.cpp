#include "core/metrology/geometric/iso230_motions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace invar::metrology {

namespace {

constexpr int draws_of_motions = 400;  // an uncertainty to 4 %

double least_squares_slope(const Eigen::VectorXd& position, const Eigen::VectorXd& value) {
  const Eigen::ArrayXd off = position.array() - position.mean();
  return (off * value.array()).sum() / off.square().sum();
}

double end_slope(const Eigen::VectorXd& position, const Eigen::VectorXd& value) {
  const Eigen::Index last = position.size() - 1;
  return (value[last] - value[0]) / (position[last] - position[0]);
}

double width_along(const Eigen::VectorXd& position, const Eigen::VectorXd& value, double slope) {
  const Eigen::VectorXd rest = value - slope * position;
  return rest.maxCoeff() - rest.minCoeff();
}

/// Indices of one side of the convex hull, places ascending: side +1 the upper, -1 the lower.
std::vector<Eigen::Index> hull(const Eigen::VectorXd& x, const Eigen::VectorXd& y, double side) {
  std::vector<Eigen::Index> chain;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    while (chain.size() >= 2) {
      const Eigen::Index a = chain[chain.size() - 2], b = chain.back();
      if (side * ((x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a])) < 0.0) break;
      chain.pop_back();
    }
    chain.push_back(i);
  }
  return chain;
}

}  // namespace

Straightness straightness(const Eigen::VectorXd& position, const Eigen::VectorXd& value) {
  Straightness result;
  result.end_points = width_along(position, value, end_slope(position, value));
  result.least_squares = width_along(position, value, least_squares_slope(position, value));
  // The narrowest zone lies along an edge of the convex hull.
  result.minimum_zone = std::numeric_limits<double>::infinity();
  for (const double side : {1.0, -1.0}) {
    const auto chain = hull(position, value, side);
    for (std::size_t i = 1; i < chain.size(); ++i) {
      const double slope =
          (value[chain[i]] - value[chain[i - 1]]) / (position[chain[i]] - position[chain[i - 1]]);
      result.minimum_zone = std::min(result.minimum_zone, width_along(position, value, slope));
    }
  }
  return result;
}

double slope_against_ends(const Eigen::VectorXd& position, const Eigen::VectorXd& value) {
  return least_squares_slope(position, value) - end_slope(position, value);
}

double angular_error(const Eigen::VectorXd& value) { return value.maxCoeff() - value.minCoeff(); }

double scatter_of(const Eigen::VectorXd& value, const Eigen::MatrixXd& factor,
                  const std::function<double(const Eigen::VectorXd&)>& figure) {
  std::mt19937_64 random{2301};
  std::normal_distribution<double> normal;
  double sum = 0.0, square = 0.0;
  Eigen::VectorXd unit(factor.cols());
  const double middle = figure(value);
  for (int d = 0; d < draws_of_motions; ++d) {
    for (double& each : unit) each = normal(random);
    const double off = figure(value + factor * unit) - middle;
    sum += off / draws_of_motions;
    square += off * off / draws_of_motions;
  }
  // About the value found: readings that scatter make a range too wide, and that counts.
  return std::sqrt(square);
}

}  // namespace invar::metrology
