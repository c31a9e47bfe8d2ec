#include "tools/geometric/controller_files.hpp"

#include <gmock/gmock.h>

#include <cstdio>
#include <random>
#include <sstream>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::tools {
namespace {

metrology::GeometricModel some_model() {
  std::mt19937_64 random{12};
  const auto machine = metrology::testing::random_machine({{1, 0, 2}, 3}, {0.2, 0.15, 0.1}, random);
  std::vector<metrology::DisplacementLine> lines;
  metrology::testing::Laser laser;
  laser.reversal = 2e-6;
  for (const auto& one : metrology::recipe_lines(machine, 0))
    lines.push_back(
        metrology::testing::measure(machine, one.name, one.from, one.to, 11, one.tool, random, laser));
  return metrology::identify(machine, lines).model;
}

TEST(ControllerFiles, TheIsgGridReadsBackAsTheSameField) {
  const auto model = some_model();
  const IsgTable table{isg_volumetric_csv(model, 41)};
  // Linear interpolation errs by at most h^2/8 max|f''| of every motion, rotations at an arm of at most the diagonal.
  const std::array<double, 3> step{0.2 / 40, 0.15 / 40, 0.1 / 40};
  double bound = 1e-9;
  for (int c = 0; c < metrology::error_motion_count; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const auto axis = static_cast<std::size_t>(metrology::axis_of(c));
    if (model.coefficients[k].size() == 0) continue;
    bound += step[axis] * step[axis] / 8 * (metrology::is_rotation(c) ? 0.27 : 1.0) *
             model.splines[axis].largest_second_derivative(model.coefficients[k]);
  }
  EXPECT_LT(bound, 2e-6);
  std::mt19937_64 random{13};
  std::uniform_real_distribution<double> part;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d position{0.2 * part(random), 0.15 * part(random), 0.1 * part(random)};
    EXPECT_LT((table.error(position) - model.error(position, model.tool)).norm(), bound);
  }
  const Eigen::Vector3d node{0.1, 0.075, 0.05};
  EXPECT_LT((table.error(node) - model.error(node, model.tool)).norm(), 1e-12);
}

TEST(ControllerFiles, TheIsgGridsOfBothDirectionsDifferByTheReversal) {
  const auto model = some_model();
  const IsgTable forward{isg_volumetric_csv(model, 11, {}, 1)};
  const IsgTable backward{isg_volumetric_csv(model, 11, {}, -1)};
  const Eigen::Vector3d node{0.1, 0.075, 0.05};
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR((forward.error(node) - backward.error(node))[k],
                model.reversal[static_cast<std::size_t>(k)].value(node[k]), 1e-12);
  EXPECT_GT(model.reversal[0].value(0.1), 1e-6);
}

TEST(ControllerFiles, TheLinuxCncFileHoldsBothDirectionsInAtMost256Points) {
  const auto model = some_model();
  const std::string text = linuxcnc_compensation(model, 0);
  std::istringstream lines{text};
  std::string line;
  int triplets = 0;
  // As the controller reads it: triplets until the first line that is none.
  for (double a = 0.0, b = 0.0, c = 0.0; std::getline(lines, line); ++triplets)
    if (std::sscanf(line.c_str(), "%lf %lf %lf", &a, &b, &c) != 3) break;
  EXPECT_GE(triplets, 2);
  EXPECT_LE(triplets, 256);
  EXPECT_EQ(line.rfind("# joint of X: nominal, actual", 0), 0U) << line;
  EXPECT_NEAR(model.reversal[0].mean(), 2e-6, 5e-7);
  for (const double x : {0.0, 0.033, 0.1, 0.171, 0.2}) {
    const double error = model.error({x, 0.0, 0.0}, model.tool).x();
    EXPECT_NEAR(linuxcnc_error(text, x, 1), error + 0.5 * model.reversal[0].value(x), 5e-8);
    EXPECT_NEAR(linuxcnc_error(text, x, -1), error - 0.5 * model.reversal[0].value(x), 5e-8);
  }
}

TEST(ControllerFiles, AWaveFinerThanTheTableIsSaid) {
  auto model = some_model();
  EXPECT_LT(linuxcnc_difference(model, 0), 3e-8);
  const auto positioning = static_cast<std::size_t>(metrology::translation(0, 0));
  model.splines[0] = {model.travel[0], 400};
  for (int of = 0; of < 3; ++of)  // all error motions of an axis have its spline
    for (const int motion : {metrology::translation(of, 0), metrology::rotation(of, 0)})
      model.coefficients[static_cast<std::size_t>(motion)].setZero(model.splines[0].size());
  for (int i = 0; i < model.splines[0].size(); ++i)
    model.coefficients[positioning][i] =
        1e-6 * std::sin(2.0 * 3.14159265358979 * model.splines[0].place(i) / 0.004);
  // h^2/8 times the curvature: (0.2/255)^2 / 8 * 1e-6 (2 pi / 0.004)^2 = 190 nm
  EXPECT_NEAR(linuxcnc_difference(model, 0), 190e-9, 30e-9);
}

TEST(ControllerFiles, SkewIsTheAngleBetweenTheAxes) {
  auto model = some_model();
  model.squareness = {1e-3, 0.0, 0.0};
  std::istringstream text{skew_numbers(model)};
  std::string line;
  while (std::getline(text, line) && line.rfind("XY", 0) != 0) {
  }
  std::istringstream cells{line};
  std::string pair, iso;
  double arcsec = 0.0;
  double urad = 0.0;
  cells >> pair >> iso >> arcsec >> urad;
  EXPECT_EQ(iso, "EC0Y");
  EXPECT_NEAR(arcsec, -206.265, 1e-3);  // the positive axes enclose less than a right angle
  EXPECT_NEAR(urad, -1000.0, 1e-2);
}

TEST(ControllerFiles, HaveNoZeroForWhatNoLineTold) {
  const auto model = some_model();
  const std::set<std::string> open{"EYY", "EC0Y"};
  const std::string skew = skew_numbers(model, open);
  EXPECT_NE(skew.find("# XY EC0Y was not measured"), std::string::npos) << skew;
  EXPECT_EQ(skew.find("\nXY EC0Y"), std::string::npos);
  const std::string table = isg_volumetric_csv(model, 5, open);
  EXPECT_NE(table.find("Not measured, hence not in here: EC0Y EYY"), std::string::npos);
  EXPECT_EQ(table.find("EYY \n"), std::string::npos) << table.substr(0, 400);
  const Eigen::Vector3d at{0.1, 0.1, 0.0};
  EXPECT_NEAR(IsgTable{table}.error(at).x(), model.error(at, model.tool).x(), 1e-6);
  EXPECT_FALSE(positioning_is_known(model, 1, open));
  EXPECT_TRUE(positioning_is_known(model, 0, open));
}

}  // namespace
}  // namespace invar::tools
