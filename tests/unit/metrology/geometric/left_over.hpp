// What an identified model leaves of a simulated machine's error over the volume, and whether it knew.
#pragma once

#include <Eigen/QR>
#include <cmath>

#include "core/metrology/geometric/geometric_field.hpp"
#include "core/metrology/geometric/geometric_model.hpp"
#include "core/metrology/geometric/machine.hpp"

namespace invar::metrology::testing {

/// Over a grid, after the best rigid motion, which displacements cannot see.
struct Left {
  double rms = 0.0;     // m, of the error vector's length
  double inside = 0.0;  // share of the error components within two of the model's sigmas
  double sigma = 0.0;   // m, RMS length of what the model expects
};

/// `model` nullptr: of the machine as it stands. `count` nodes an axis.
inline Left left_over(const Machine& machine, const GeometricModel* model, int count) {
  const Eigen::Matrix3d directions = axis_directions(machine.chain, machine.errors->squareness);
  const auto grid = volume_grid(machine.chain, machine.travel, count);
  Eigen::MatrixXd modes(3 * static_cast<long>(grid.size()), 6);
  Eigen::VectorXd field(modes.rows());
  Eigen::VectorXd sigma = Eigen::VectorXd::Zero(modes.rows());
  for (std::size_t g = 0; g < grid.size(); ++g) {
    const long r = 3 * static_cast<long>(g);
    Eigen::Vector3d e = simulated_error(machine, directions, grid[g], machine.tool);
    if (model != nullptr) {
      e -= model->error(grid[g], machine.tool);
      sigma.segment<3>(r) = model->sigma_at(grid[g], machine.tool);
    }
    for (int k = 0; k < 3; ++k)
      if (!machine.chain.has(k)) e[k] = sigma[r + k] = 0.0;
    field.segment<3>(r) = e;
    modes.middleRows<3>(r) = RigidPart::rigid(machine.chain, grid[g]);
  }
  field -= modes * modes.completeOrthogonalDecomposition().solve(field).eval();
  double inside = 0.0;
  double all = 0.0;
  for (long r = 0; r < field.size(); ++r) {
    if (!machine.chain.has(static_cast<int>(r % 3))) continue;
    all += 1.0;
    inside += std::abs(field[r]) <= 2.0 * sigma[r] ? 1.0 : 0.0;
  }
  const double nodes = static_cast<double>(grid.size());
  return {std::sqrt(field.squaredNorm() / nodes), inside / all, std::sqrt(sigma.squaredNorm() / nodes)};
}

}  // namespace invar::metrology::testing
