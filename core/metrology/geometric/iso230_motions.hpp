// ISO 230-1: straightness and angular error of a linear axis, from values of one error motion at places along it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

namespace invar::metrology {

/// Straightness error (ISO 230-1:2012, 3.4): largest less smallest deviation from a reference straight line, in the unit of
/// the values.
struct Straightness {
  double end_points = 0.0;     // line through the first and the last place
  double least_squares = 0.0;  // least-squares line
  double minimum_zone = 0.0;   // between two parallel lines as near together as can be
};
/// Places ascending, two or more. The slope of the readings counts in none.
Straightness straightness(const Eigen::VectorXd& position, const Eigen::VectorXd& value);

/// Slope of the least-squares line less that of the line through the ends: what the reference line changes of a squareness.
double slope_against_ends(const Eigen::VectorXd& position, const Eigen::VectorXd& value);

/// Largest less smallest value: the angular error over the travel (ISO 230-1:2012, 3.5).
double angular_error(const Eigen::VectorXd& value);

/// Standard deviation of a figure where the values scatter by `factor` times independent unit normals (values x n). Seeded:
/// the same each time.
double scatter_of(const Eigen::VectorXd& value, const Eigen::MatrixXd& factor,
                  const std::function<double(const Eigen::VectorXd&)>& figure);

}  // namespace invar::metrology
