#include "core/metrology/geometric/geometric_stages.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

enum class Role { axis, parallel, plane_diagonal, elsewhere };

double distance_beside(const CondensedLine& line) {
  double sum = 0.0;
  for (int k = 0; k < 3; ++k)
    if (std::abs(line.beam.direction[k]) < 1e-6) sum += line.beam.start[k] * line.beam.start[k];
  return std::sqrt(sum);
}

int moving_axes(const CondensedLine& line) {
  return static_cast<int>((line.beam.direction.array().abs() > 1e-6).count());
}

/// What each line is for: the nearest to the origin of its kind identifies, the others beside it compare.
std::vector<Role> roles_of(const std::vector<CondensedLine>& lines) {
  std::array<double, 8> nearest;
  nearest.fill(std::numeric_limits<double>::infinity());
  const auto set_of = [](const CondensedLine& line) {
    std::size_t set = 0;
    for (int k = 0; k < 3; ++k)
      if (std::abs(line.beam.direction[k]) > 1e-6) set |= std::size_t{1} << static_cast<std::size_t>(k);
    return set;
  };
  for (const auto& line : lines)
    nearest[set_of(line)] = std::min(nearest[set_of(line)], distance_beside(line));
  std::vector<Role> roles;
  for (const auto& line : lines) {
    const bool first = distance_beside(line) < nearest[set_of(line)] + 1e-6;
    if (moving_axes(line) == 1)
      roles.push_back(first ? Role::axis : Role::parallel);
    else
      roles.push_back(moving_axes(line) == 2 && first ? Role::plane_diagonal : Role::elsewhere);
  }
  return roles;
}

/// The step in which an error motion is found.
Role step_of(int motion) {
  if (is_positioning(motion)) return Role::axis;
  if (is_straightness(motion)) return Role::plane_diagonal;
  return direction_of(motion) == axis_of(motion) ? Role::elsewhere : Role::parallel;
}

}  // namespace

Eigen::VectorXd mean_in_stages(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                               const GeometricBasis& basis, const GeometricPrior& prior, double misfit) {
  NormalEquations nothing;
  nothing.normal = Eigen::MatrixXd::Zero(basis.size, basis.size);
  nothing.right = Eigen::VectorXd::Zero(basis.size);
  const Eigen::MatrixXd beforehand = solve(nothing, basis, prior).prior_covariance;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(basis.size);
  const std::vector<Role> roles = roles_of(lines);
  for (const Role step : {Role::axis, Role::parallel, Role::plane_diagonal, Role::elsewhere}) {
    std::vector<CondensedLine> chosen_lines;
    std::vector<LineRows> chosen_rows;
    for (std::size_t l = 0; l < lines.size(); ++l) {
      if (roles[l] != step) continue;
      chosen_lines.push_back(lines[l]);
      chosen_rows.push_back(rows[l]);
    }
    std::vector<int> unknown;
    for (const auto& block : basis.blocks)
      if (step_of(block.motion) == step)
        for (int i = 0; i < block.size(); ++i) unknown.push_back(block.first + i);
    if (step == Role::plane_diagonal)
      for (int i = basis.first_squareness(); i < basis.first_expansion(); ++i) unknown.push_back(i);
    if (step == Role::axis)
      for (int i = basis.first_wave(); i < basis.first_squareness(); ++i) unknown.push_back(i);
    if (step == Role::axis)
      for (int i = basis.first_expansion(); i < basis.size; ++i) unknown.push_back(i);
    if (chosen_lines.empty() || unknown.empty()) continue;
    const NormalEquations equations = assemble(chosen_lines, chosen_rows, basis.size, misfit);
    const auto count = static_cast<Eigen::Index>(unknown.size());
    const Eigen::MatrixXd covariance = beforehand(unknown, unknown);
    const Eigen::MatrixXd precision =
        numerics::solve_positive(covariance, Eigen::MatrixXd::Identity(count, count));
    // What earlier steps found is taken as known; the unknowns of this one are still zero in `mean`.
    const Eigen::VectorXd right = equations.right - equations.normal * mean;
    const Eigen::MatrixXd normal = equations.normal(unknown, unknown) + precision;
    const Eigen::VectorXd found = numerics::solve_positive(normal, Eigen::VectorXd{right(unknown)});
    mean(unknown) = found;
  }
  return mean;
}

}  // namespace invar::metrology
