// Plots of the pages of geometric calibrations and measuring plans, and how the pages name places.
#pragma once

#include "tools/geometric/geometric_report.hpp"

namespace invar::tools {

/// X, Y or Z.
std::string letter(int axis);
/// "(x, y, z)" in mm.
std::string place(const Eigen::Vector3d& position);
/// One without points yet.
report::Series series(const std::string& label, report::Series::Style style, const std::string& colour);
/// How much of each component's variance the lines leave; `known` leads to its standard deviation ("known to").
void draw_variance_left(report::Page& page, const metrology::Identifiability& knowledge,
                        const std::string& known);
/// A component over its axis with its two-sigma band and what the readings say of it.
report::Plot component_plot(const GeometricResult& result, int component);
/// Measured, fitted and predicted deviation along one line.
report::Plot line_plot(const GeometricResult& result, std::size_t line);
/// Lost motion of an axis over its position, with its two-sigma band.
report::Plot reversal_plot(const metrology::GeometricModel& model, int axis);
/// The error vectors over every plane of two axes, at the middle of the third, less the plane's rigid motion.
std::vector<report::Plot> field_plots(const metrology::GeometricModel& model);
/// Residuals of the points, beside a normal distribution.
report::Plot residual_histogram(const GeometricResult& result);

}  // namespace invar::tools
