// Plot: what to draw; gnuplot draws it as SVG.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/range.hpp"

namespace invar::report {

/// One curve, cloud, band or grid in a plot. NaN breaks a line.
struct Series {
  enum class Style { line, dashed, points, steps, band, bars, vectors, heat };
  std::string label;  // empty: not in the key
  Style style = Style::line;
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> u;  // band: upper edge; vectors: x part; heat: the value
  std::vector<double> v;  // vectors: y part
  std::string colour;     // "#rrggbb"; empty: the next of the palette
};

struct Plot {
  std::string title;
  std::string x_label;  // with its unit: "x [mm]"
  std::string y_label;
  std::vector<Series> series;
  std::optional<Range> x_range;
  std::optional<Range> y_range;
  bool equal_axes = false;
  bool log_x = false;
  bool log_y = false;
  int width = 720;   // px
  int height = 360;  // px
};

/// Both axes from -m to m and of one scale, where m takes in every point: a target with its hits.
void centre(Plot& plot);

/// Value and sigma of a curve at a place, in the plot's units.
struct CurvePoint {
  double value = 0.0;
  double sigma = 0.0;
};
/// Adds a line and, behind it, its band of two standard deviations, at 201 places of `range` (the plot's x).
void add_curve(Plot& plot, const Range& range, const std::string& label, const std::string& colour,
               const std::function<CurvePoint(double x)>& at);

/// Counts of `values` in 25 bars of `width` about zero, drawn at `unit` times where they lie.
Series histogram(const std::vector<double>& values, double width, double unit);

/// One <svg> element a plot, in order, drawn by one gnuplot process. Long lines are thinned to about 4000
/// points by their local extremes, so that a peak is never lost. Where gnuplot is missing or refuses a plot, a
/// paragraph in its place says why: a report never fails on a plot.
std::vector<std::string> draw(const std::vector<Plot>& plots);

}  // namespace invar::report
