// The HTML page of a geometric calibration: what was found, how sure it is, what it leaves, what is still open.
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/geometric/geometric_report.hpp"

namespace invar::tools {

namespace {

using metrology::GeometricModel;
using report::number;
using report::Plot;
using report::Series;

std::size_t index(int i) { return static_cast<std::size_t>(i); }
std::string letter(int axis) { return std::string(1, metrology::axis_letters[index(axis)]); }

std::string place(const Eigen::Vector3d& p) {
  return "(" + number(1e3 * p.x(), 4) + ", " + number(1e3 * p.y(), 4) + ", " + number(1e3 * p.z(), 4) + ")";
}

Series series(const std::string& label, Series::Style style, const std::string& colour) {
  Series result;
  result.label = label;
  result.style = style;
  result.colour = colour;
  return result;
}

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
    data.y.push_back(1e6 * (model.component(component, point.q) + point.rest / point.share));
  }
  return data;
}

/// A component over its axis with its two-sigma band and what the readings say of it.
Plot component_plot(const GeometricResult& result, int component) {
  const GeometricModel& model = result.found.model;
  const bool angle = metrology::is_rotation(component);
  const int axis = metrology::axis_of(component);
  const Range range = model.travel[index(axis)];
  Series line = series("", Series::Style::line, "#1f5fa8");
  Series band = series("", Series::Style::band, "#9db9d8");
  for (int i = 0; i <= 120; ++i) {
    const double q = range.lower + range.width() * i / 120.0;
    const double value = 1e6 * model.component(component, q);
    const double sigma = 2e6 * model.component_sigma(component, q);
    line.x.push_back(1e3 * q);
    line.y.push_back(value);
    band.x.push_back(1e3 * q);
    band.y.push_back(value - sigma);
    band.u.push_back(value + sigma);
  }
  Plot plot;
  plot.title = std::string{metrology::iso_name(component)} + " = " + metrology::seed_name(component);
  plot.x_label = letter(axis) + " [mm]";
  plot.y_label = angle ? "[urad]" : "[um]";
  plot.series = {band, component_data(result, component), line};
  plot.width = 380;
  plot.height = 240;
  return plot;
}

/// Measured, fitted and predicted deviation along one line.
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

/// The error vectors over the plane of the first two axes of the chain, at the middle of the third.
Plot field_plot(const GeometricModel& model) {
  const int a = std::min(model.chain.order[0], model.chain.order[1]);
  const int b = std::max(model.chain.order[0], model.chain.order[1]);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    if (model.chain.has(k)) middle[k] = 0.5 * (model.travel[index(k)].lower + model.travel[index(k)].upper);
  Series arrows = series("", Series::Style::vectors, "#1f5fa8");
  constexpr int nodes = 13;
  double longest = 0.0;
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
  const Eigen::Vector3d motion = normal.ldlt().solve(right);
  longest = 0.0;
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
  plot.title = "error vectors less rigid motion, the longest is " + report::si(longest, "m");
  plot.x_label = letter(a) + " [mm]";
  plot.y_label = letter(b) + " [mm]";
  plot.series = {arrows};
  plot.equal_axes = true;
  plot.width = 480;
  plot.height = 460;
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

void write_lines(report::Page& page, const GeometricResult& result) {
  const bool full = result.method == "full" && result.found.lines.size() > 1;
  std::vector<std::string> header{"line",       "length [mm]", "readings",      "outliers",
                                  "breaks",     "noise [um]",  "reversal [um]", "drift [um]",
                                  "before RMS", "before max",  "after RMS",     "after max"};
  if (full) header.insert(header.end(), {"unseen RMS", "unseen max"});
  std::vector<std::vector<std::string>> rows;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) {
    const auto& line = result.found.lines[l];
    const auto& f = result.figures[l];
    std::vector<std::string> row{line.name,
                                 number(1e3 * line.beam.length, 4),
                                 std::to_string(line.noise.readings),
                                 std::to_string(line.noise.outliers),
                                 std::to_string(line.noise.breaks.size()),
                                 number(1e6 * line.noise.noise),
                                 number(1e6 * line.noise.reversal),
                                 number(1e6 * line.noise.drift),
                                 number(1e6 * f.before_rms),
                                 number(1e6 * f.before_max),
                                 number(1e6 * f.after_rms),
                                 number(1e6 * f.after_max)};
    if (full) row.insert(row.end(), {number(1e6 * f.unseen_rms), number(1e6 * f.unseen_max)});
    rows.push_back(std::move(row));
  }
  page.table(header, rows);
  if (full)
    page.paragraph(
        "Errors of displacement in um. \"Unseen\" is the line predicted from the others alone, as it would "
        "have "
        "been without measuring it.");
  std::vector<std::vector<std::string>> paths;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) {
    const auto& line = result.found.lines[l];
    if ((line.beam.direction.array().abs() > 1e-6).count() < 2) continue;
    const auto& f = result.figures[l];
    const double after = full ? f.unseen_max : f.after_max;
    const Eigen::Vector3d end = line.beam.start + line.beam.length * line.beam.direction;
    paths.push_back({line.name, place(line.beam.start), place(end), number(1e3 * line.beam.length, 4),
                     number(1e6 * f.before_max), number(1e6 * after),
                     number(100.0 * (1.0 - after / std::max(f.before_max, 1e-12)))});
  }
  if (!paths.empty())
    page.table({"diagonal", "from [mm]", "to [mm]", "range [mm]", "max error before [um]",
                full ? "max error after, not fitted [um]" : "max error after [um]", "improvement [%]"},
               paths);
  std::vector<Plot> plots;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) plots.push_back(line_plot(result, l));
  page.plots(std::move(plots),
             "Displacement error along each line: measured before compensation (points), the model (blue), "
             "left after it (green), and "
             "left after a compensation that never saw this line (dashed).");
}

void write_components(report::Page& page, const GeometricResult& result) {
  const GeometricModel& model = result.found.model;
  std::vector<std::vector<std::string>> rows;
  for (int pair = 0; pair < metrology::squareness_count; ++pair) {
    if (model.squareness_sigma[index(pair)] <= 0.0) continue;
    const double angle = metrology::squareness_angle_from_cosine(pair, model.squareness[index(pair)]);
    constexpr double arcsec = 4.84813681e-6;
    rows.push_back({std::string{metrology::squareness_iso_name(pair)},
                    std::string{metrology::squareness_seed_name(pair)}, number(1e6 * angle, 5),
                    number(angle / arcsec, 5), number(2e6 * model.squareness_sigma[index(pair)])});
  }
  page.table({"squareness", "seed's symbol", "ISO [urad]", "[arcsec]", "2 sigma [urad]"}, rows);
  rows.clear();
  std::vector<Plot> plots;
  for (int c = 0; c < metrology::component_count; ++c) {
    if (model.coefficients[index(c)].size() == 0) continue;
    plots.push_back(component_plot(result, c));
    const Range range = model.travel[index(metrology::axis_of(c))];
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    double sigma = 0.0;
    for (int i = 0; i <= 100; ++i) {
      const double q = range.lower + range.width() * i / 100.0;
      lowest = std::min(lowest, model.component(c, q));
      highest = std::max(highest, model.component(c, q));
      sigma = std::max(sigma, model.component_sigma(c, q));
    }
    rows.push_back({std::string{metrology::iso_name(c)}, metrology::seed_name(c), number(1e6 * lowest),
                    number(1e6 * highest), number(2e6 * sigma), metrology::is_rotation(c) ? "urad" : "um"});
  }
  page.table({"component", "seed's symbol", "lowest", "highest", "2 sigma at most", "unit"}, rows);
  page.plots(std::move(plots),
             "Each error motion with its two-sigma band; points: the fit plus what is left of each reading, "
             "over the "
             "motion's share in it. Zero at the origin of its axis; straightness "
             "without end-point slope, which is squareness.");
}

void write_knowledge(report::Page& page, const GeometricResult& result) {
  const auto& knowledge = result.knowledge;
  page.paragraph(
      "Expected RMS length of the remaining error vector over the volume, rigid motion of the frame "
      "removed: " +
      report::si(knowledge.volumetric_rms, "m") +
      " (before measuring: " + report::si(knowledge.volumetric_rms_prior, "m") + ").");
  if (knowledge.unidentified.empty()) page.callout("The lines identify every component.", "good");
  for (const auto& one : knowledge.unidentified) page.callout(one.words(), "warn");
  if (!result.next.empty()) {
    std::vector<std::vector<std::string>> rows;
    for (const auto& next : result.next) {
      rows.push_back(
          {next.line.name, place(next.line.from), place(next.line.to), report::si(next.volumetric_rms, "m")});
    }
    page.paragraph("The next lines that would help most:");
    page.table({"line", "from [mm]", "to [mm]", "expected with it"}, rows);
  }
  Series bars = series("", Series::Style::bars, "#9db9d8");
  std::vector<std::vector<std::string>> rows;
  double x = 1.0;
  for (const auto& component : knowledge.components) {
    bars.x.push_back(x++);
    bars.y.push_back(100.0 * component.left);
    rows.push_back({component.name, number(100.0 * component.left, 2) + " %", number(1e6 * component.sigma)});
  }
  Plot plot;
  plot.title = "share of the prior's variance that the lines leave";
  plot.x_label = "component, in the order of the table";
  plot.y_label = "[%]";
  plot.series = {bars};
  page.plot(std::move(plot));
  page.table({"component", "left open", "sigma [um or urad]"}, rows);
}

/// Accuracy against data interval, from the same readings thinned.
void write_intervals(report::Page& page, const GeometricResult& result) {
  page.heading("Data interval");
  Series expected = series("expected over the volume", Series::Style::line, "#1f5fa8");
  Series on_points = series("on all points, those left out included", Series::Style::dashed, "#2e8b57");
  std::vector<std::vector<std::string>> rows;
  for (const auto& one : result.intervals) {
    rows.push_back({report::si(one.interval, "m"), std::to_string(one.points),
                    report::si(one.points_rms, "m"), number(1e7 * one.integral),
                    report::si(one.expected_rms, "m")});
    expected.x.push_back(1e3 * one.interval);
    expected.y.push_back(1e6 * one.expected_rms);
    on_points.x.push_back(1e3 * one.interval);
    on_points.y.push_back(1e6 * one.points_rms);
  }
  if (const auto* chosen = interval_to_choose(result))
    page.callout("Choose " + report::si(chosen->interval, "m") +
                     ": the coarsest interval that costs at most a tenth of the accuracy.",
                 "good");
  page.table({"interval", "points used", "RMS on all points", "integral on the longest line [1e-7 m2]",
              "expected over the volume"},
             rows);
  Plot plot;
  plot.title = "accuracy against data interval";
  plot.x_label = "interval [mm]";
  plot.y_label = "RMS [um]";
  plot.series = {expected, on_points};
  page.plot(std::move(plot));
}

}  // namespace

report::Page report_page(const GeometricResult& result) {
  const auto& found = result.found;
  report::Page page{"Geometric calibration", result.lines_file.filename().string() + " on " +
                                                 result.machine_file.filename().string() + ", method " +
                                                 result.method};
  page.callout(
      "Error of displacement on the lines: " + report::si(result.before_rms, "m") + " before, " +
          report::si(result.after_rms, "m") + " after" +
          (result.unseen_rms > 0.0 ? ", " + report::si(result.unseen_rms, "m") + " on lines not fitted"
                                   : "") +
          " (RMS)",
      "good");
  page.paragraph(std::to_string(found.lines.size()) + " lines, " + std::to_string(result.input.rows) +
                 " readings; noise of one reading " + report::si(found.noise, "m") +
                 ", what no smooth model explains " + report::si(found.misfit, "m") + ".");
  if (const std::string words = temperature_words(result); !words.empty())
    page.paragraph("Temperature" + words.substr(std::string{"temperature"}.size()) + ".");
  for (const auto& name : result.input.without_length)
    page.callout("Line " + name + " has no length and was left out.", "warn");
  if (result.input.far_off > 0)
    page.callout(std::to_string(result.input.far_off) + " readings far off were left out.", "warn");
  page.heading("What the lines tell and what they leave open");
  write_knowledge(page, result);
  page.heading("Lines");
  write_lines(page, result);
  page.heading("Components");
  write_components(page, result);
  page.heading("Field");
  page.plots({field_plot(found.model), residual_histogram(result)});
  if (!result.intervals.empty()) {
    write_intervals(page, result);
  }
  return page;
}

}  // namespace invar::tools
