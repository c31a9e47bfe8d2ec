// The short ways to the field's variance and to what the other lines tell, against the long ones.
#include "core/metrology/geometric/geometric_field.hpp"

#include <gtest/gtest.h>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology {
namespace {

Identification found_on(const Chain& chain, int level, unsigned seed) {
  std::mt19937_64 random{seed};
  const Machine machine = testing::random_machine(chain, {0.2, 0.15, 0.1}, random);
  testing::Laser laser;
  laser.temperature = 20.0;
  laser.warming = 0.5;
  laser.outliers = 0.02;
  std::vector<DisplacementLine> lines;
  for (const auto& one : recipe_lines(machine, level))
    lines.push_back(testing::measure(machine, one.name, one.from, one.to, 11, one.tool, random, laser));
  return identify(machine, lines);
}

TEST(GeometricField, VarianceOfAPlaceIsThatOfItsMapOfTheUnknowns) {
  for (const Chain& chain : {Chain{{1, 0, 2}, 2}, Chain{{2, 0, 1}, 3}}) {
    const Identification found = found_on(chain, 0, 21);
    const auto& model = found.model;
    const RigidPart rigid =
        rigid_part(found.basis, model.squareness, volume_grid(chain, model.travel, 5), model.tool);
    const FieldVariance variance{found.basis, model.squareness, rigid, found.posterior.widened};
    for (const Eigen::Vector3d& place :
         {Eigen::Vector3d{0, 0, 0}, Eigen::Vector3d{0.2, 0.15, 0.1}, Eigen::Vector3d{0.071, 0.033, 0.052}}) {
      const Eigen::Vector3d tool{0.01, -0.02, 0.03};
      const Eigen::MatrixXd map = shape_map(found.basis, model.squareness, rigid, place, tool);
      const Eigen::Vector3d expected = (map * found.posterior.widened * map.transpose()).diagonal();
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(variance.at(place, tool)[k], chain.has(k) ? expected[k] : 0.0,
                    1e-8 * expected.maxCoeff() + 1e-20);
    }
  }
}

TEST(GeometricField, OtherLinesTellWhatSolvingWithoutTheLineGives) {
  const Identification found = found_on({{1, 0, 2}, 3}, 1, 22);
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    auto lines = found.lines;
    auto rows = found.rows;
    auto weights = found.point_weights;
    const auto at = static_cast<std::ptrdiff_t>(l);
    lines.erase(lines.begin() + at);
    rows.erase(rows.begin() + at);
    weights.erase(weights.begin() + at);
    const NormalEquations others = assemble(lines, rows, found.basis.size, found.misfit, weights);
    const Eigen::VectorXd mean = solve_mean(others, found.basis, found.prior).mean;
    const Eigen::VectorXd expected = found.rows[l].rows * mean(found.rows[l].unknowns);
    const Eigen::VectorXd told =
        told_by_others(found.lines[l], found.rows[l], found.misfit, found.point_weights[l], found.posterior);
    EXPECT_LT((told - expected).cwiseAbs().maxCoeff(), 1e-10) << found.lines[l].name;
  }
}

}  // namespace
}  // namespace invar::metrology
