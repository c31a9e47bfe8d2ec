// Points at which a model of a whole machine is asked, and the table of its answers.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/recording/table.hpp"

namespace invar::tools {

struct FieldPoints {
  std::vector<Eigen::Vector3d> positions;  // m; an axis without a column is at 0
  std::vector<Eigen::Vector3d> tools;      // m; `tool` where there is no column tool_x, tool_y, tool_z
  /// Sense of each axis' last motion, +1 or -1, by the column `direction` of all, or direction_x, _y, _z; 0 without: the
  /// error is then the mean of both.
  std::vector<Eigen::Vector3d> moving;
};
FieldPoints read_points(const recording::Table& inputs, const Eigen::Vector3d& tool);

struct FieldValue {
  Eigen::Vector3d error;  // m; a value that is not known: NaN, and infinite sigma
  Eigen::Vector3d sigma;  // m
};
/// error_x .. error_z, sigma_x .. sigma_z.
recording::Table field_table(const std::vector<FieldValue>& values);
FieldValue unknown_value();

}  // namespace invar::tools
