#include "tools/geometric/field_points.hpp"

#include <array>
#include <limits>
#include <string>
#include <utility>

#include "core/base/fault.hpp"
#include "core/metrology/geometric/error_motions.hpp"

namespace invar::tools {

FieldPoints read_points(const recording::Table& inputs, const Eigen::Vector3d& tool) {
  FieldPoints points;
  points.positions.assign(inputs.rows(), Eigen::Vector3d::Zero());
  points.tools.assign(inputs.rows(), tool);
  bool any = false;
  for (int k = 0; k < 3; ++k) {
    const std::string letter(1, metrology::axis_letters[static_cast<std::size_t>(k)]);
    const auto fill = [&](const std::string& name, std::vector<Eigen::Vector3d>& into) {
      const auto values = inputs.optionally_in(name, "m");
      for (std::size_t i = 0; values && i < values->size(); ++i) into[i][k] = (*values)[i];
      return values.has_value();
    };
    any = fill(letter, points.positions) || any;
    (void)fill("tool_" + letter, points.tools);
  }
  points.moving.assign(inputs.rows(), Eigen::Vector3d::Zero());
  for (int k = 0; k < 3; ++k) {
    const std::string own =
        "direction_" + std::string(1, metrology::axis_letters[static_cast<std::size_t>(k)]);
    const std::string name = inputs.has(own) ? own : "direction";
    const auto values = inputs.optionally_in(name, "1");
    for (std::size_t i = 0; values && i < values->size(); ++i) {
      const double value = (*values)[i];
      if (std::isnan(value)) continue;  // not told
      if (value != 1.0 && value != 0.0 && value != -1.0)
        throw InputError{inputs.file.string() + ": column `" + name + "`, row " + std::to_string(i + 1),
                         "is no direction", "write 1, -1, or 0 for the mean of both"};
      points.moving[i][k] = value;
    }
  }
  if (!any) (void)inputs.in("x", "m");  // says what is missing
  return points;
}

FieldValue unknown_value() {
  return {Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()),
          Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity())};
}

recording::Table field_table(const std::vector<FieldValue>& values) {
  std::array<std::vector<double>, 6> columns;
  for (const FieldValue& value : values)
    for (int k = 0; k < 3; ++k) {
      columns[static_cast<std::size_t>(k)].push_back(value.error[k]);
      columns[static_cast<std::size_t>(k) + 3].push_back(value.sigma[k]);
    }
  const std::array<const char*, 6> names{"error_x", "error_y", "error_z", "sigma_x", "sigma_y", "sigma_z"};
  recording::Table result;
  for (std::size_t c = 0; c < 6; ++c) result.add(names[c], "m", std::move(columns[c]));
  return result;
}

}  // namespace invar::tools
