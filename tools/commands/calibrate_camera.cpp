// `invar calibrate camera`: the scale of a camera from a picture of circles of known radius.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/new_file.hpp"
#include "core/vision/camera_file.hpp"
#include "core/vision/library.hpp"
#include "core/vision/ruler_file.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/commands/calibrate_camera.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

struct Results {
  const vision::RulerFit& fit;
  const vision::Pixels& image;
};

/// Every circle of the ruler is used, or the picture is refused; whether their radii are met to their noise is tested.
report::LeftOut rows_of(const Results& r) {
  report::LeftOut rows;
  rows.row = "circle";
  rows.unit = "px";
  rows.given = rows.used = r.fit.circles.size();
  std::vector<double> residual;
  double squares = 0.0;
  for (const vision::RulerCircle& circle : r.fit.circles) {
    residual.push_back(circle.residual);
    if (circle.sigma > 0.0) squares += std::pow(circle.residual / circle.sigma, 2);
  }
  if (residual.empty()) return rows;
  rows.rms_used = rows.rms_all = report::rms_of(residual);
  const double times = std::sqrt(squares / static_cast<double>(residual.size()));
  constexpr double plainly = 3.0;
  if (times > plainly)
    rows.unexplained.push_back("The radii are met to " + report::number(times, 2) +
                               " times their noise: the ruler, or the camera, is not as modelled.");
  return rows;
}

nlohmann::json report_json(const Results& r) {
  const vision::CameraModel& camera = r.fit.camera;
  nlohmann::json out;
  out["scale"] = {{"value", camera.scale}, {"unit", "m/px"}, {"sigma", camera.scale_sigma}};
  out["residual_px"] = r.fit.residual;
  out["calibrated_at"] = calibrated_at();
  out["rows"] = report::json_of(rows_of(r));
  out["unidentified"] = nlohmann::json::array();
  const double corner = camera.center.squaredNorm();
  if (r.fit.distortion_identified) {
    out["distortion"] = {{"value", camera.distortion}, {"unit", "1/px2"}, {"sigma", camera.distortion_sigma}};
  } else {
    out["unidentified"].push_back(
        {{"what", "distortion"}, {"corner_share_2_sigma", 2.0 * camera.distortion_sigma * corner}});
  }
  if (r.fit.aspect_identified) {
    out["aspect"] = {{"value", camera.aspect}, {"sigma", camera.aspect_sigma}};
  } else {
    out["unidentified"].push_back({{"what", "aspect"}, {"share_2_sigma", 2.0 * camera.aspect_sigma}});
  }
  if (r.fit.offset_identified)
    out["outline_offset"] = {{"value", r.fit.offset}, {"unit", "px"}, {"sigma", r.fit.offset_sigma}};
  for (const vision::RulerCircle& c : r.fit.circles)
    out["circles"].push_back({{"radius_m", c.radius},
                              {"x_px", c.outline.x},
                              {"y_px", c.outline.y},
                              {"radius_px", c.outline.equal_area_radius()},
                              {"residual_px", c.residual}});
  return out;
}

report::Page make_page(const Results& r) {
  using report::number;
  const vision::CameraModel& camera = r.fit.camera;
  report::Page page{"Camera", "Scale from circles of known radius"};
  page.callout("Scale " + number(camera.scale * 1e6, 7) + " um/px, standard deviation " +
                   number(camera.scale_sigma * 1e9, 2) + " nm/px (" +
                   number(1e6 * camera.scale_sigma / camera.scale, 2) + " ppm)",
               "good");
  const double corner = camera.center.squaredNorm();
  page.paragraph(r.fit.distortion_identified
                     ? "Radial distortion: " + number(100.0 * camera.distortion * corner, 3) +
                           " % in the corner, standard deviation " +
                           number(100.0 * camera.distortion_sigma * corner, 2) + " %."
                     : "Radial distortion is not identified: below " +
                           number(200.0 * camera.distortion_sigma * corner, 2) +
                           " % in the corner (two standard deviations). Left at zero.");
  page.paragraph(r.fit.aspect_identified
                     ? "Scale along y over scale along x: " + number(camera.aspect, 7) +
                           ", standard deviation " + number(camera.aspect_sigma, 2) + "."
                     : "Pixels are square within " + number(2.0 * camera.aspect_sigma, 2) +
                           " (two standard deviations).");
  if (r.fit.offset_identified)
    page.paragraph("Every outline lies " + number(r.fit.offset, 3) +
                   " px outside its circle (standard deviation " + number(r.fit.offset_sigma, 2) +
                   " px): the exposure or the print spreads it. The scale is free of it; diameters of drops "
                   "are not corrected by it.");
  std::vector<std::vector<std::string>> rows;
  report::Series residual{"", report::Series::Style::points, {}, {}, {}, {}, ""};
  for (const vision::RulerCircle& c : r.fit.circles) {
    rows.push_back({number(c.radius * 1e3, 6), number(c.outline.x, 6), number(c.outline.y, 6),
                    number(c.outline.equal_area_radius(), 6), number(1000.0 * c.residual, 2),
                    number(1000.0 * c.sigma, 2)});
    residual.x.push_back(c.radius * 1e3);
    residual.y.push_back(1000.0 * c.residual);
  }
  report::show(page, rows_of(r));
  page.table({"radius [mm]", "x [px]", "y [px]", "radius [px]", "residual [1/1000 px]", "sigma [1/1000 px]"},
             rows);
  std::vector<vision::AnnotatedOutline> outlines;
  for (const vision::RulerCircle& c : r.fit.circles)
    outlines.push_back({c.outline, vision::Colour::green, number(c.radius * 1e3, 4) + " mm"});
  page.image(vision::library().draw_outlines(r.image.view(), outlines), "image/png",
             "The ruler with the outlines that were fitted");
  page.plot({.title = "Radius: measured minus modelled",
             .x_label = "radius [mm]",
             .y_label = "difference [1/1000 px]",
             .series = {residual},
             .x_range = {},
             .y_range = {}});
  return page;
}

void calibrate_by_ruler(const CameraOptions& options) {
  const auto radii = vision::radii_of(vision::read_ruler(*options.ruler));
  const vision::Pixels image = vision::library().read(*options.image);
  vision::RulerFailure failure;
  const auto fit = vision::library().calibrate(image.view(), radii, failure);
  if (!fit) throw InputError{options.image->string(), failure.what, "see " + options.ruler->string()};

  const Results results{*fit, image};
  write_camera_result(options.out, vision::camera_yaml(fit->camera), report_json(results).dump(2),
                      make_page(results));
  const vision::CameraModel& camera = fit->camera;
  std::cout << "scale " << report::number(camera.scale * 1e6, 7) << " um/px, sigma "
            << report::number(camera.scale_sigma * 1e9, 2) << " nm/px (" << fit->circles.size()
            << " circles, edges " << report::number(fit->residual, 2) << " px RMS)\n";
  if (fit->distortion_identified)
    std::cout << "radial distortion "
              << report::number(100.0 * camera.distortion * camera.center.squaredNorm(), 3)
              << " % in the corner\n";
  else
    std::cout << "radial distortion not identified\n";
  if (fit->offset_identified)
    std::cout << "outlines lie " << report::number(fit->offset, 3) << " px outside their circles\n";
  for (const auto& what : rows_of(results).unexplained) std::cout << "not explained: " << what << '\n';
  if (fit->aspect_identified) std::cout << "aspect " << report::number(camera.aspect, 7) << '\n';
  std::cout << written(options.out, "camera.yaml") << '\n';
}

}  // namespace

void write_camera_result(const std::filesystem::path& folder, const std::string& camera,
                         const std::string& json, const report::Page& page) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed || !std::filesystem::is_directory(folder))
    throw InputError{folder.string(), "cannot be made", "name a folder that may be written to"};
  page.write(folder / "report.html");
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream out = new_stream(folder / name);
    out << text << '\n';
    out.close();
    if (!out) throw InputError{(folder / name).string(), "cannot be written", "check the space left"};
  };
  write("report.json", json);
  write("camera.yaml", camera);  // last: where it is, all is there
}

void add_calibrate_camera(CLI::App& group) {
  auto* command = group.add_subcommand(
      "camera", "Scale of a camera from a ruler of circles, or its lens from views of a target");
  command->footer(
      "Examples: invar calibrate camera --image ruler.png --ruler ruler.yaml --out result\n"
      "          invar calibrate camera --target target.csv --view view1.csv --view view2.csv ... --out "
      "result\n"
      "target.csv has x and y on the flat target. Each view has the same points as u [px], v [px].\n"
      "Views that are held out choose the lens.");
  auto options = std::make_shared<CameraOptions>();
  command->add_option("--image", options->image, "picture of circles of known radius");
  command->add_option("--ruler", options->ruler,
                      "ruler.yaml: circles: [{radius: 5.0e-4}, ...] in m, any order");
  command->add_option("--target", options->target, "points of a flat target: x [m], y [m]");
  command
      ->add_option("--view", options->views,
                   "the same points in one picture: u [px], v [px]; at least four times")
      ->type_size(1)
      ->expected(-1);
  command->add_option(
      "--plane", options->plane,
      "the --view in which the target lies on the substrate: droplets are measured in its plane");
  command->add_option("--out", options->out, "folder for camera.yaml, report.json and report.html")
      ->required();
  command->callback([options] {
    if (options->target) {
      if (options->image || options->ruler)
        throw InputError{"--target", "goes with --view alone", "give either a ruler or a target"};
      return calibrate_by_target(*options);
    }
    if (!options->views.empty()) throw InputError{"--target", "is missing", "give the points of the target"};
    if (!options->image) throw InputError{"--image", "is missing", "give the picture of the ruler"};
    if (!options->ruler)
      throw InputError{"--ruler", "is missing", "give ruler.yaml with the radii of the circles"};
    calibrate_by_ruler(*options);
  });
}

}  // namespace invar::tools
