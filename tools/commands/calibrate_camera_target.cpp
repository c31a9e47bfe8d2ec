// `invar calibrate camera --target --view`: a pinhole camera with its lens from views of a flat target.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "core/metrology/camera/bad_views.hpp"
#include "core/metrology/camera/planar_camera.hpp"
#include "core/numerics/robust.hpp"
#include "core/numerics/significance.hpp"
#include "core/recording/table.hpp"
#include "core/vision/camera_file.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/commands/calibrate_camera.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;

// Two columns of coordinates. Headers are `x [in]` as everywhere, or `X_in`, as many target files have it.
Matrix2Xd read_points(const std::filesystem::path& file, const std::array<std::string, 2>& names,
                      const std::string& unit) {
  recording::Table table = recording::Table::read(file);
  for (recording::Column& column : table.columns) {
    const auto bar = column.name.find('_');
    if (!column.unit.empty() || bar == std::string::npos) continue;
    column.unit = column.name.substr(bar + 1);
    column.name = column.name.substr(0, bar);
  }
  Matrix2Xd out(2, static_cast<Index>(table.rows()));
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (recording::Column& column : table.columns) {
      if (column.name.size() == 1 && std::tolower(column.name[0]) == names[axis][0])
        column.name = names[axis];
      if (column.unit == "in") {  // the inch is no unit of ours: 25.4 mm exactly
        for (double& value : column.values) value *= 0.0254;
        column.unit = "m";
      }
    }
    const auto values = table.in(names[axis], unit);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i]))
        throw InputError{file.string() + ": column `" + names[axis] + "`, row " + std::to_string(i + 1),
                         "is not a finite number", "every point needs both coordinates"};
      out(static_cast<Index>(axis), static_cast<Index>(i)) = values[i];
    }
  }
  return out;
}

struct Rival {
  metrology::PlanarCalibration fit;
  std::vector<double> left_out;  // px, a view
  double held_out = 0.0;         // px, RMS over the views
};

/// The numbers that the lens has: what was not fitted is not there.
nlohmann::json numbers(const metrology::PinholeCamera& c, metrology::Lens lens) {
  using metrology::Lens;
  const std::size_t radial = lens == Lens::pinhole    ? 0
                             : lens == Lens::radial_1 ? 1
                             : lens == Lens::radial_3 ? 3
                                                      : 2;
  nlohmann::json json{{"fx", c.fx}, {"fy", c.fy}, {"u0", c.u0}, {"v0", c.v0}, {"skew", c.skew}};
  json["radial"] =
      std::vector<double>(c.radial.begin(), c.radial.begin() + static_cast<std::ptrdiff_t>(radial));
  if (lens == Lens::radial_2_tangential) json["tangential"] = c.tangential;
  return json;
}

/// The plane of the target in one view, and how well the target fixes the scale there.
vision::CameraPlane plane_of(const Rival& best, const metrology::TargetPose& pose, const Matrix2Xd& view,
                             double rms) {
  const double angle = pose.rotation.norm();
  const Eigen::Matrix3d rotation = angle > 0.0
                                       ? Eigen::AngleAxisd{angle, pose.rotation / angle}.toRotationMatrix()
                                       : Eigen::Matrix3d::Identity();
  vision::CameraPlane plane;
  plane.view.camera = best.fit.camera;
  plane.view.normal = rotation.col(2);
  if (plane.view.normal.z() < 0.0) plane.view.normal = -plane.view.normal;
  plane.view.distance = plane.view.normal.dot(pose.position) / plane.view.normal.z();
  // One component of a point is off by rms / sqrt 2; a scale is fitted to the distances from their middle.
  const double spread = (view.colwise() - view.rowwise().mean()).norm();
  plane.scale_sigma = plane.view.scale() * rms / std::sqrt(2.0) / spread;
  return plane;
}

/// The plane of `--plane`; nothing where none is named.
std::optional<vision::CameraPlane> plane_of(const CameraOptions& options, const Rival& best,
                                            const metrology::SortedViews& sorted,
                                            const std::vector<Matrix2Xd>& good) {
  if (!options.plane) return std::nullopt;
  for (std::size_t k = 0; k < sorted.good.size(); ++k)
    if (options.views[sorted.good[k]] == *options.plane)
      return plane_of(best, best.fit.views[k].pose, good[k], best.fit.views[k].rms);
  const bool given =
      std::find(options.views.begin(), options.views.end(), *options.plane) != options.views.end();
  throw InputError{options.plane->string(),
                   given ? "was left out: it does not go with the other views" : "is no --view",
                   "name the view of the target that lies on the substrate"};
}

/// What each view left out is wrong with, by its file.
std::vector<std::string> bad_views_of(const metrology::SortedViews& sorted, const CameraOptions& options) {
  std::vector<std::string> out;
  for (const auto& bad : sorted.bad)
    out.push_back(options.views[bad.view].filename().string() + ": " + bad.why);
  return out;
}

/// Whether the residuals are noise: along the rows of each view's points neighbours must not deviate alike.
double chance_of_noise(const metrology::PlanarCalibration& fit) {
  std::array<std::vector<double>, 2> residual;
  for (const auto& view : fit.views)
    for (Index i = 0; i < view.residuals.cols(); ++i)
      for (std::size_t axis = 0; axis < 2; ++axis)
        residual[axis].push_back(view.residuals(static_cast<Index>(axis), i));
  return std::min(1.0, 2.0 * std::min(numerics::chance_of_alike_neighbours(residual[0]),
                                      numerics::chance_of_alike_neighbours(residual[1])));
}

report::LeftOut rows_of(const Rival& best, const metrology::SortedViews& sorted, Index points,
                        const CameraOptions& options) {
  report::LeftOut rows;
  rows.row = "view";
  rows.unit = "px";
  rows.given = sorted.good.size() + sorted.bad.size();
  rows.used = sorted.good.size();
  rows.reasons = {{sorted.bad.size(), "since they do not go with the others"}};
  rows.rms_used = rows.rms_all = best.fit.rms;
  rows.header = {"view", "why", "error by this camera"};
  double squares = best.fit.rms * best.fit.rms * static_cast<double>(sorted.good.size());
  for (const auto& bad : sorted.bad) {
    const std::string file = options.views[bad.view].filename().string();
    rows.rows.push_back({file, bad.why, std::isnan(bad.rms) ? "cannot be told" : report::si(bad.rms, "px")});
    squares += bad.rms * bad.rms;
  }
  rows.rms_all = std::sqrt(squares / static_cast<double>(rows.given));
  // A view that is met far worse than others is used, and said.
  constexpr double uncertain = 3.0;
  const double usual = numerics::median(best.left_out);
  for (std::size_t k = 0; k < best.left_out.size(); ++k)
    if (best.left_out[k] > uncertain * usual)
      rows.unexplained.push_back(options.views[sorted.good[k]].filename().string() + " is met to " +
                                 report::si(best.left_out[k], "px") +
                                 " by the camera of the others, a typical view to " +
                                 report::si(usual, "px") + ": its corners are less certain; it is used.");
  const double chance = chance_of_noise(best.fit);
  if (chance < 0.01)
    rows.unexplained.push_back(
        "The residual of the " + std::to_string(points) +
        " points goes on from one point to the next (p = " + report::number(chance, 2) +
        "): no lens here, or the target, is as it is to the noise of the corners; the sigmas "
        "count the points as independent.");
  return rows;
}

report::Page make_page(const std::vector<Rival>& rivals, const Rival& best,
                       const std::vector<Matrix2Xd>& views, const CameraOptions& options,
                       const metrology::SortedViews& sorted, const report::LeftOut& left_out) {
  using report::number;
  report::Page page{"Camera",
                    "Pinhole and lens from " + std::to_string(views.size()) + " views of a flat target"};
  const Rival& nominal = rivals.front();
  page.callout("Held-out views: " + number(nominal.held_out, 4) + " px with an ideal pinhole, " +
                   number(best.held_out, 4) + " px with " + metrology::name(best.fit.lens) +
                   " (chosen by it)",
               !sorted.bad.empty()            ? "warn"
               : left_out.unexplained.empty() ? "good"
                                              : "plain");
  for (const auto& what : bad_views_of(sorted, options)) page.callout("Left out: " + what, "warn");
  report::show(page, left_out);
  std::vector<std::vector<std::string>> rows;
  for (const Rival& r : rivals) {
    std::vector<std::string> row{metrology::name(r.fit.lens), number(r.fit.rms, 4), number(r.held_out, 4)};
    for (const double rms : r.left_out) row.push_back(number(rms, 3));
    rows.push_back(row);
  }
  std::vector<std::string> header{"lens", "fitted RMS [px]", "held-out RMS [px]"};
  for (const std::size_t view : sorted.good)
    header.push_back("without " + options.views[view].stem().string());
  page.table(header, rows);
  const metrology::PinholeCamera &c = best.fit.camera, &s = best.fit.sigma;
  const auto row = [](const char* name, double value, double sigma, const char* unit) {
    return std::vector<std::string>{name, number(value, 7), number(sigma, 2), unit};
  };
  std::vector<std::vector<std::string>> camera{row("fx", c.fx, s.fx, "px"), row("fy", c.fy, s.fy, "px"),
                                               row("u0", c.u0, s.u0, "px"), row("v0", c.v0, s.v0, "px"),
                                               row("skew", c.skew, s.skew, "px")};
  const char* radial[] = {"k1", "k2", "k3"};
  const char* tangential[] = {"p1", "p2"};
  for (std::size_t k = 0; k < 3; ++k)
    if (s.radial[k] > 0.0) camera.push_back(row(radial[k], c.radial[k], s.radial[k], ""));
  for (std::size_t k = 0; k < 2; ++k)
    if (s.tangential[k] > 0.0) camera.push_back(row(tangential[k], c.tangential[k], s.tangential[k], ""));
  page.table({"", "value", "sigma", "unit"}, camera);
  constexpr double exaggeration = 30.0;
  const auto arrows = [&](const Rival& rival, const std::string& title) {
    report::Series series{"", report::Series::Style::vectors, {}, {}, {}, {}, ""};
    for (std::size_t v = 0; v < views.size(); ++v)
      for (Index i = 0; i < views[v].cols(); ++i) {
        series.x.push_back(views[v](0, i));
        series.y.push_back(-views[v](1, i));
        series.u.push_back(exaggeration * rival.fit.views[v].residuals(0, i));
        series.v.push_back(-exaggeration * rival.fit.views[v].residuals(1, i));
      }
    return report::Plot{.title = title,
                        .x_label = "u [px]",
                        .y_label = "-v [px]",
                        .series = {series},
                        .x_range = {},
                        .y_range = {},
                        .equal_axes = true,
                        .width = 560,
                        .height = 440};
  };
  page.plots({arrows(nominal, "Ideal pinhole"), arrows(best, metrology::name(best.fit.lens))},
             "Seen minus projected, all views, 30 times enlarged");
  return page;
}

}  // namespace

void calibrate_by_target(const CameraOptions& options) {
  const Matrix2Xd target = read_points(*options.target, {"x", "y"}, "m");
  if (target.cols() < 6)
    throw InputError{options.target->string(), "has only " + std::to_string(target.cols()) + " points",
                     "at least 6 are needed"};
  std::vector<Matrix2Xd> views;
  for (const auto& file : options.views) {
    views.push_back(read_points(file, {"u", "v"}, "px"));
    if (views.back().cols() != target.cols())
      throw InputError{file.string(),
                       "has " + std::to_string(views.back().cols()) + " points, the target " +
                           std::to_string(target.cols()),
                       "give the same points in the same order"};
  }
  if (views.size() < 4)
    throw InputError{options.views.empty() ? std::string{"--view"} : options.views.back().string(),
                     "only " + std::to_string(views.size()) + " views are given",
                     "three fix a camera, a fourth tells whether it holds: give at least 4"};
  const metrology::SortedViews sorted = metrology::sort_views(target, views);
  if (sorted.good.size() < 4 && !sorted.bad.empty())
    throw InputError{options.views[sorted.bad.front().view].string(), sorted.bad.front().why,
                     "mend it or give another: " + std::to_string(sorted.good.size()) +
                         " views are left without those that do not go with the others, 4 are needed"};
  std::vector<Matrix2Xd> good;
  for (const std::size_t v : sorted.good) good.push_back(std::move(views[v]));
  views = std::move(good);
  std::vector<Rival> rivals;
  for (const metrology::Lens lens : metrology::lenses) {
    const auto fit = metrology::calibrate_planar(target, views, lens);
    const auto left_out = metrology::leave_one_view_out(target, views, lens);
    if (!fit || !left_out) continue;
    Rival rival{*fit, *left_out, 0.0};
    for (const double rms : *left_out) rival.held_out += rms * rms / static_cast<double>(left_out->size());
    rival.held_out = std::sqrt(rival.held_out);
    rivals.push_back(std::move(rival));
  }
  if (rivals.empty() || rivals.front().fit.lens != metrology::Lens::pinhole)
    throw InputError{options.target->string(), "the views do not determine a camera",
                     "tilt the target differently from view to view"};
  const Rival& best = *std::min_element(
      rivals.begin(), rivals.end(), [](const Rival& a, const Rival& b) { return a.held_out < b.held_out; });

  nlohmann::json json;
  json["model"] = metrology::name(best.fit.lens);
  json["calibrated_at"] = calibrated_at();
  json["camera"] = numbers(best.fit.camera, best.fit.lens);
  json["sigma"] = numbers(best.fit.sigma, best.fit.lens);
  json["rms_px"] = best.fit.rms;
  json["held_out_rms_px"] = best.held_out;
  json["unidentified"] = nlohmann::json::array();
  const report::LeftOut left_out = rows_of(best, sorted, target.cols(), options);
  json["rows"] = report::json_of(left_out);
  for (const auto& what : bad_views_of(sorted, options)) json["views_left_out"].push_back(what);
  for (const Rival& r : rivals)
    json["lenses"].push_back({{"lens", metrology::name(r.fit.lens)},
                              {"rms_px", r.fit.rms},
                              {"held_out_rms_px", r.held_out},
                              {"left_out_px", r.left_out}});
  const auto plane = plane_of(options, best, sorted, views);
  if (plane)
    json["plane"] = {{"distance_m", plane->view.distance},
                     {"normal", {plane->view.normal.x(), plane->view.normal.y(), plane->view.normal.z()}},
                     {"scale_m_px", plane->view.scale()},
                     {"scale_sigma_m_px", plane->scale_sigma}};
  write_camera_result(
      options.out,
      vision::camera_yaml(best.fit.camera, best.fit.sigma, metrology::name(best.fit.lens), plane),
      json.dump(2), make_page(rivals, best, views, options, sorted, left_out));
  for (const auto& what : bad_views_of(sorted, options)) std::cout << "left out: " << what << '\n';
  for (const Rival& r : rivals)
    std::cout << metrology::name(r.fit.lens) << ": fitted " << report::number(r.fit.rms, 4)
              << " px, held-out views " << report::number(r.held_out, 4) << " px"
              << (&r == &best ? "  <- chosen" : "") << '\n';
  if (plane)
    std::cout << "plane " << report::si(plane->view.distance, "m", 5) << " away, "
              << report::with_sigma(1e6 * plane->view.scale(), 1e6 * plane->scale_sigma, "um/px")
              << " there\n";
  else
    std::cout << "note: without --plane VIEW a picture measured by this camera needs the distance of the "
                 "substrate\n";
  std::cout << line_of(left_out) << '\n';
  for (const auto& what : left_out.unexplained) std::cout << "note: " << what << '\n';
  std::cout << written(options.out, "camera.yaml") << '\n';
}

}  // namespace invar::tools
