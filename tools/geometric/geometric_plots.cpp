#include "tools/geometric/geometric_plots.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::tools {

namespace {

using metrology::GeometricModel;
using report::Plot;
using report::Series;

/// What the readings say of a component: its fit plus what is left of each reading, over the component's share in it. Only
/// readings in which it weighs at least half as much as it can.
Series component_data(const GeometricResult& result, int component) {
  const auto& found = result.found;
  const GeometricModel& model = found.model;
  const int axis = metrology::axis_of(component);
  const Eigen::Matrix3d directions = metrology::axis_directions(model.chain, model.squareness);
  const Eigen::Vector3d along = Eigen::Vector3d::Unit(metrology::direction_of(component));
  struct Point {
    double q, share, rest;
  };
  std::vector<Point> points;
  double largest = 0.0;
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    const auto& line = found.lines[l];
    if (std::abs(line.beam.direction[axis]) < 1e-6) continue;  // its axis stands still
    for (std::size_t j = 0; j < line.points.size(); ++j) {
      const double rest = result.rest[l][static_cast<Eigen::Index>(j)];
      if (!std::isfinite(rest)) continue;
      const Eigen::Vector3d arm =
          metrology::lever_arms(model.chain, directions, line.points[j], line.tools[j]).col(axis);
      const double share =
          line.beam.direction.dot(metrology::is_rotation(component) ? along.cross(arm) : along);
      points.push_back({line.points[j][axis], share, rest});
      largest = std::max(largest, std::abs(share));
    }
  }
  Series data = series("", Series::Style::points, "#c98a2b");
  for (const Point& point : points) {
    if (std::abs(point.share) < 0.5 * largest || largest < 1e-9) continue;
    data.x.push_back(1e3 * point.q);
    data.y.push_back(1e6 * (model.error_motion(component, point.q) + point.rest / point.share));
  }
  return data;
}

/// The error vectors over the plane of two axes, at the middle of the third.
Plot field_plot(const GeometricModel& model, int a, int b) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    if (model.chain.has(k)) middle[k] = 0.5 * (model.travel[index(k)].lower + model.travel[index(k)].upper);
  Series arrows = series("", Series::Style::vectors, "#1f5fa8");
  constexpr int nodes = 13;
  std::vector<Eigen::Vector3d> errors;
  for (int i = 0; i < nodes * nodes; ++i) {
    Eigen::Vector3d position = middle;
    position[a] = model.travel[index(a)].lower + model.travel[index(a)].width() * (i % nodes) / (nodes - 1);
    position[b] = model.travel[index(b)].lower + model.travel[index(b)].width() * (i / nodes) / (nodes - 1);
    errors.push_back(model.error(position, model.tool));
    arrows.x.push_back(1e3 * position[a]);
    arrows.y.push_back(1e3 * position[b]);
  }
  // The frame is a convention: shift and turn of the plane are taken out, so that the shape shows.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const auto modes = [&](std::size_t i) {
    Eigen::Matrix<double, 2, 3> m;
    m << 1.0, 0.0, -arrows.y[i], 0.0, 1.0, arrows.x[i];
    return m;
  };
  for (std::size_t i = 0; i < errors.size(); ++i) {
    normal += modes(i).transpose() * modes(i);
    right += modes(i).transpose() * Eigen::Vector2d{errors[i][a], errors[i][b]};
  }
  const Eigen::Vector3d motion = numerics::solve_symmetric(normal, right);
  double longest = 0.0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const Eigen::Vector2d taken = modes(i) * motion;
    errors[i][a] -= taken[0];
    errors[i][b] -= taken[1];
    longest = std::max(longest, std::hypot(errors[i][a], errors[i][b]));
  }
  const double scale = longest > 0.0 ? 1e3 * model.travel[index(a)].width() / (nodes - 1) / longest : 0.0;
  for (const auto& e : errors) {
    arrows.u.push_back(scale * e[a]);
    arrows.v.push_back(scale * e[b]);
  }
  Plot plot;
  plot.title =
      letter(a) + letter(b) + " plane before compensation, longest vector " + report::si(longest, "m");
  plot.x_label = letter(a) + " [mm]";
  plot.y_label = letter(b) + " [mm]";
  plot.series = {arrows};
  plot.equal_axes = true;
  const auto widened = [&](int axis) {
    const Range r = model.travel[index(axis)];
    const double margin = 0.1 * std::max(model.travel[index(a)].width(), model.travel[index(b)].width());
    return Range{1e3 * (r.lower - margin), 1e3 * (r.upper + margin)};
  };
  plot.x_range = widened(a);
  plot.y_range = widened(b);
  plot.width = 480;
  plot.height = 460;
  return plot;
}

}  // namespace

std::string letter(int axis) { return std::string(1, metrology::axis_letters[index(axis)]); }

std::string place(const Eigen::Vector3d& position) {
  std::string text = "(";
  for (int k = 0; k < 3; ++k) text += report::number(1e3 * position[k], 5) + (k < 2 ? ", " : ")");
  return text;
}

Series series(const std::string& label, Series::Style style, const std::string& colour) {
  Series result;
  result.label = label;
  result.style = style;
  result.colour = colour;
  return result;
}

Plot component_plot(const GeometricResult& result, int component) {
  const GeometricModel& model = result.found.model;
  const bool angle = metrology::is_rotation(component);
  const int axis = metrology::axis_of(component);
  const Range range = model.travel[index(axis)];
  Series line = series("", Series::Style::line, "#1f5fa8");
  Series band = series("", Series::Style::band, "#9db9d8");
  for (int i = 0; i <= 120; ++i) {
    const double q = range.lower + range.width() * i / 120.0;
    const double value = 1e6 * model.error_motion(component, q);
    const double sigma = 2e6 * model.error_motion_sigma(component, q);
    line.x.push_back(1e3 * q);
    line.y.push_back(value);
    band.x.push_back(1e3 * q);
    band.y.push_back(value - sigma);
    band.u.push_back(value + sigma);
  }
  Plot plot;
  plot.title = std::string{metrology::iso_name(component)} + " = " + metrology::thesis_symbol(component);
  plot.x_label = letter(axis) + " [mm]";
  plot.y_label = angle ? "[urad]" : "[um]";
  plot.series = {band, component_data(result, component), line};
  plot.width = 380;
  plot.height = 240;
  return plot;
}

Plot line_plot(const GeometricResult& result, std::size_t l) {
  const auto& line = result.found.lines[l];
  const Eigen::VectorXd fitted = metrology::predicted_readings(result.found.model, line);
  std::vector<std::size_t> order(line.points.size());
  for (std::size_t j = 0; j < order.size(); ++j) order[j] = j;
  const auto along = [&](std::size_t j) { return line.beam.direction.dot(line.points[j] - line.beam.start); };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return along(a) < along(b); });
  Series measured = series("", Series::Style::points, "#c0392b");
  Series model = series("", Series::Style::line, "#1f5fa8");
  Series left = series("", Series::Style::line, "#2e8b57");
  Series unseen = series("", Series::Style::dashed, "#7d3c98");
  double offset = 0.0;
  double count = 0.0;
  for (const std::size_t j : order) {
    const auto i = static_cast<Eigen::Index>(j);
    if (!std::isfinite(line.deviation[i])) continue;
    offset += line.deviation[i] - fitted[i];
    count += 1.0;
  }
  offset /= std::max(count, 1.0);
  for (const std::size_t j : order) {
    const auto i = static_cast<Eigen::Index>(j);
    const double q = 1e3 * along(j);
    measured.x.push_back(q);
    measured.y.push_back(1e6 * (line.deviation[i] - offset));
    model.x.push_back(q);
    model.y.push_back(1e6 * fitted[i]);
    left.x.push_back(q);
    left.y.push_back(1e6 * (line.deviation[i] - offset - fitted[i]));
    if (result.unseen[l].size() == 0) continue;
    unseen.x.push_back(q);
    unseen.y.push_back(1e6 * result.unseen[l][i]);
  }
  Plot plot;
  plot.title = "line " + line.name;
  plot.x_label = "along the beam [mm]";
  plot.y_label = "[um]";
  plot.series = {measured, model, left};
  if (!unseen.x.empty()) plot.series.push_back(unseen);
  plot.width = 480;
  plot.height = 260;
  return plot;
}

Plot residual_histogram(const GeometricResult& result) {
  std::vector<double> rest;
  for (const auto& line : result.rest)
    for (const double value : line)
      if (std::isfinite(value)) rest.push_back(1e6 * value);
  double square = 0.0;
  for (const double r : rest) square += r * r;
  const double sigma = std::sqrt(square / static_cast<double>(std::max<std::size_t>(rest.size(), 1)));
  constexpr int bins = 31;
  const double half = 4.0 * std::max(sigma, 1e-6);
  Series bars = series("points", Series::Style::bars, "#9db9d8");
  Series normal = series("normal of the same deviation", Series::Style::line, "#c0392b");
  std::vector<double> count(bins, 0.0);
  for (const double r : rest) {
    const int bin = static_cast<int>(std::floor((r + half) / (2 * half) * bins));
    if (bin >= 0 && bin < bins) count[index(bin)] += 1.0;
  }
  for (int i = 0; i < bins; ++i) {
    const double centre = -half + (i + 0.5) * 2 * half / bins;
    bars.x.push_back(centre);
    bars.y.push_back(count[index(i)]);
    normal.x.push_back(centre);
    normal.y.push_back(static_cast<double>(rest.size()) * 2 * half / bins /
                       (std::max(sigma, 1e-6) * 2.5066282746) *
                       std::exp(-0.5 * centre * centre / std::max(sigma * sigma, 1e-12)));
  }
  Plot plot;
  plot.title = "residuals of the points";
  plot.x_label = "[um]";
  plot.y_label = "points";
  plot.series = {bars, normal};
  plot.width = 480;
  plot.height = 280;
  return plot;
}

void draw_variance_left(report::Page& page, const metrology::Identifiability& knowledge,
                        const std::string& known) {
  std::vector<report::Page::Bar> bars;
  for (const auto& component : knowledge.components)
    bars.push_back({component.name, 100.0 * component.left,
                    report::number(100.0 * component.left, 2) + " %, " + known + " " +
                        micro(component.sigma) +
                        (component.name[1] >= 'A' && component.name[1] <= 'C' ? " urad" : " um"),
                    "#9db9d8"});
  page.bars("Share of the variance expected beforehand that the lines leave, standard deviation", bars);
}

Plot reversal_plot(const GeometricModel& model, int axis) {
  const auto& curve = model.reversal[index(axis)];
  Plot plot;
  plot.title = "Reversal of " + letter(axis);
  plot.x_label = letter(axis) + " [mm]";
  plot.y_label = "forward minus backward [um]";
  const Range range = curve.spline.interval();
  report::add_curve(plot, {1e3 * range.lower, 1e3 * range.upper}, "", "#1f5fa8", [&](double mm) {
    return report::CurvePoint{1e6 * curve.value(1e-3 * mm), 1e6 * curve.sigma_at(1e-3 * mm)};
  });
  return plot;
}

std::vector<Plot> field_plots(const GeometricModel& model) {
  std::vector<Plot> plots;
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (model.chain.has(a) && model.chain.has(b)) plots.push_back(field_plot(model, a, b));
  return plots;
}

}  // namespace invar::tools
