// Waves of a screw, a rack or a scale: periodic errors of positioning whose period nobody told.
#pragma once

#include <optional>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/geometric_equations.hpp"
#include "core/metrology/geometric/geometric_model.hpp"

namespace invar::metrology {

/// [m, rad] The median step of a line's points along an axis; nothing where fewer than three are apart.
std::optional<double> usual_step(const CondensedLine& line, int axis);

/// Waves that the lines show beyond the smooth curves of `basis`, strongest first. They are found one by one over the
/// wave number by their evidence, each in the residual of the others. `basis` may hold waves already; they are not found again.
/// Where all places are so regular that two periods look alike, the longer one is taken. Set-up only.
std::vector<AxisWave> find_waves(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                                 const std::vector<Eigen::VectorXd>& points, double misfit,
                                 const GeometricBasis& basis, const GeometricPrior& prior);

/// Splines, coefficients and squareness of a model from the unknowns: axes with waves get splines that are fine enough to
/// carry them to a thousandth.
void take_unknowns(GeometricModel& model, const GeometricBasis& basis, const Eigen::VectorXd& unknowns);

}  // namespace invar::metrology
