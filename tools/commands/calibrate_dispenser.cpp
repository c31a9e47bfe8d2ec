// `invar calibrate dispenser`: where droplets land that were aimed at their targets, and where to aim instead.
#include <cmath>
#include <iostream>
#include <memory>

#include "core/base/angle.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/metrology/droplet/droplet_trajectory.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

namespace {

using metrology::Droplets;
using metrology::TrajectoryFit;
using report::number;
using report::si;

Droplets read_droplets(const recording::Table& table) {
  const auto column = [&](const std::string& name, const char* unit, double largest) {
    auto values = table.in(name, unit);
    expect_finite(table.file, name, values, largest);
    return values;
  };
  const auto n = static_cast<Eigen::Index>(table.rows());
  const auto pair = [&](const std::string& name, const char* unit, double largest) {
    const auto x = column(name + "_x", unit, largest);
    const auto y = column(name + "_y", unit, largest);
    Eigen::Matrix2Xd both(2, n);
    for (Eigen::Index i = 0; i < n; ++i)
      both.col(i) << x[static_cast<std::size_t>(i)], y[static_cast<std::size_t>(i)];
    return both;
  };
  Droplets drops;
  drops.target = pair("target", "m", 100.0);
  drops.landed = pair("landed", "m", 100.0);
  const auto height = column("height", "m", 10.0);
  drops.height = Eigen::Map<const Eigen::VectorXd>(height.data(), n);
  if (drops.height.minCoeff() <= 0.0)
    throw InputError{table.file.string() + ": column `height`", "a height is not positive",
                     "give the distance from nozzle to substrate"};
  if (table.has("stage_velocity_x")) drops.stage_velocity = pair("stage_velocity", "m/s", 100.0);
  if (table.has("diameter")) {
    const auto diameter = table.in("diameter", "m");
    drops.diameter = Eigen::Map<const Eigen::VectorXd>(diameter.data(), n);
  }
  if (n < 2)
    throw InputError{table.file.string(), "has one droplet only",
                     "print four droplets at each of two heights"};
  return drops;
}

report::Plot scatter_plot(const Droplets& drops, const TrajectoryFit& fit, bool after) {
  report::Plot plot;
  plot.title = after ? "Landing after compensation" : "Landing before compensation";
  plot.x_label = "x from target [um]";
  plot.y_label = "y from target [um]";
  plot.height = 480;
  report::Series kept[2];
  kept[0].label = "lowest height";
  kept[1].label = "other heights";
  report::Series rejected;
  rejected.label = "satellites";
  const double low = drops.height.minCoeff() * 1.01;
  for (Eigen::Index i = 0; i < drops.height.size(); ++i) {
    const Eigen::Vector2d at = after ? Eigen::Vector2d{fit.residual.col(i)}
                                     : Eigen::Vector2d{drops.landed.col(i) - drops.target.col(i)};
    if (after && fit.kept(i) <= 0.0) continue;
    report::Series& into = fit.kept(i) <= 0.0 ? rejected : kept[drops.height(i) > low];
    into.x.push_back(1e6 * at.x());
    into.y.push_back(1e6 * at.y());
  }
  for (report::Series* series : {&kept[0], &kept[1], &rejected}) {
    series->style = report::Series::Style::points;
    plot.series.push_back(std::move(*series));
  }
  report::centre(plot);
  return plot;
}

/// Table 5.3: each height, before and after.
std::vector<std::vector<std::string>> before_and_after(const Droplets& drops, const TrajectoryFit& fit) {
  std::vector<std::vector<std::string>> rows;
  std::vector<double> heights;
  for (const double h : drops.height) {
    bool known = false;
    for (const double other : heights) known = known || std::abs(h - other) < 0.01 * drops.height.maxCoeff();
    if (!known) heights.push_back(h);
  }
  for (const double h : heights) {
    double before = 0.0;
    double after = 0.0;
    double count = 0.0;
    for (Eigen::Index i = 0; i < drops.height.size(); ++i) {
      if (fit.kept(i) <= 0.0 || std::abs(drops.height(i) - h) >= 0.01 * drops.height.maxCoeff()) continue;
      before += (drops.landed.col(i) - drops.target.col(i)).squaredNorm();
      after += fit.residual.col(i).squaredNorm();
      count += 1.0;
    }
    if (count <= 0.0) continue;
    before = std::sqrt(before / count);
    after = std::sqrt(after / count);
    rows.push_back({si(h, "m"), number(count), si(before, "m"), si(after, "m"),
                    number(100.0 * (1.0 - after / before)) + " %"});
  }
  return rows;
}

/// Rows that were left out and the error with them: as it is to expect of new droplets, not of those fitted.
report::LeftOut left_out_of(const Droplets& drops, const TrajectoryFit& fit) {
  report::LeftOut left_out;
  left_out.row = "droplet";
  left_out.given = static_cast<std::size_t>(fit.kept.size());
  left_out.used = static_cast<std::size_t>(fit.kept.sum());
  left_out.reasons = {{left_out.given - left_out.used, "as satellites, by their size or their place"}};
  left_out.header = {"droplet", "target x", "target y", "height", "left x", "left y"};
  std::vector<double> used, all;
  for (Eigen::Index i = 0; i < fit.kept.size(); ++i) {
    all.push_back(fit.residual.col(i).norm());
    if (fit.kept(i) > 0.0) {
      used.push_back(all.back());
      continue;
    }
    left_out.rows.push_back({std::to_string(i + 1), si(drops.target(0, i), "m", 4),
                             si(drops.target(1, i), "m", 4), si(drops.height(i), "m"),
                             si(fit.residual(0, i), "m"), si(fit.residual(1, i), "m")});
  }
  left_out.rms_used = report::rms_of(used);
  left_out.rms_all = report::rms_of(all);
  if (fit.scatter.tested && fit.scatter.probability < metrology::significant)
    left_out.unexplained.push_back("The residual is more than scatter: " + fit.scatter.pattern +
                                   " explains a part of it that chance would in " +
                                   number(100.0 * fit.scatter.probability, 2) +
                                   " % of cases; no model here has it.");
  return left_out;
}

/// What the tests of the residual allow to say of it.
std::string left_words(const TrajectoryFit& fit) {
  const auto& test = fit.scatter;
  if (!test.tested) return "too few droplets to test whether the residual is scatter";
  const std::string chance = "(p = " + number(test.probability, 2) + ")";
  if (test.probability < metrology::significant)
    return "the residual is more than scatter " + chance + ": " + test.pattern;
  return "tests of the residual, over the targets and in order, find scatter alone " + chance;
}

/// Rotation, scale and squareness of the field, with their sigmas.
void add_field(const metrology::DropletTrajectory& path, const TrajectoryFit& fit,
               std::vector<std::vector<std::string>>& rows, nlohmann::json& report) {
  if (fit.field_form == metrology::FieldForm::none) return;
  const auto& m = path.field;
  const double sigma_x = std::sqrt(path.field_covariance(0, 0)),
               sigma_y = std::sqrt(path.field_covariance(1, 1));
  const double rotation = 0.5 * (m(1, 0) - m(0, 1));
  const bool any = fit.field_form == metrology::FieldForm::any;
  const double rotation_sigma = any ? 0.5 * std::hypot(sigma_x, sigma_y) : sigma_x;
  const auto ppm = [](double value) { return number(1e6 * value, 4) + " ppm"; };
  rows.push_back({"rotation of the field", "", number(rotation / degree, 4) + " deg",
                  number(rotation_sigma / degree) + " deg"});
  rows.push_back({any ? "scale of the field along x" : "scale of the field", "", ppm(m(0, 0)), ppm(sigma_x)});
  if (any) {
    rows.push_back({"scale of the field along y", "", ppm(m(1, 1)), ppm(sigma_y)});
    rows.push_back({"squareness of the field", "", number((m(0, 1) + m(1, 0)) / degree, 4) + " deg",
                    number(2.0 * rotation_sigma / degree) + " deg"});
  }
  report["field"] = {{"rotation_rad", rotation},
                     {"rotation_sigma_rad", rotation_sigma},
                     {"scale", {m(0, 0), m(1, 1)}},
                     {"scale_sigma", {sigma_x, sigma_y}},
                     {"squareness_rad", m(0, 1) + m(1, 0)},
                     {"centre_m", {path.field_centre.x(), path.field_centre.y()}},
                     {"chance", fit.field_probability}};
}

void calibrate(const std::filesystem::path& file, const std::filesystem::path& folder) {
  const auto table = recording::Table::read(file, {"image", "status"});
  const Droplets drops = read_droplets(table);
  const TrajectoryFit fit = metrology::identify_trajectory(drops);
  const auto& path = fit.trajectory;
  const bool tilt_known = fit.unidentified.empty();
  const auto rejected = drops.height.size() - static_cast<Eigen::Index>(fit.kept.sum());

  compensation::ModelText text{"dispenser", {file}};
  compensation::write_trajectory(text, path);
  nlohmann::json report;
  report["kind"] = "dispenser";
  report["droplets"] = drops.height.size();
  report["rejected"] = rejected;
  report["before_rms_m"] = fit.before_rms;
  if (std::isfinite(fit.after_rms)) report["after_rms_m"] = fit.after_rms;
  report["placement_m"] = {path.placement.x(), path.placement.y()};
  report["slope"] = {path.slope.x(), path.slope.y()};
  report["scatter_m"] = {{"at_nozzle", fit.scatter_at_nozzle}, {"per_height", fit.scatter_per_height}};
  report["unidentified"] = fit.unidentified;
  report["notes"] = fit.notes;
  report["scatter_test"] = {
      {"tested", fit.scatter.tested}, {"probability", fit.scatter.probability}, {"words", left_words(fit)}};
  const report::LeftOut left_out = left_out_of(drops, fit);
  report["rows"] = report::json_of(left_out);
  report::Page page{"Dispenser calibration", file.filename().string() + ", " +
                                                 std::to_string(drops.height.size()) + " droplets, " +
                                                 std::to_string(rejected) + " rejected as satellites"};
  page.callout("Droplets land " + si(fit.before_rms, "m") + " from their targets (RMS), " +
                   si(fit.after_rms, "m") + " after compensation; " + left_words(fit),
               left_out.unexplained.empty() ? "good" : "warn");
  for (const auto& what : fit.unidentified) page.callout("Not identified: " + what, "warn");
  for (const auto& note : fit.notes) page.paragraph(note);
  report::show(page, left_out);
  page.heading("Trajectory");
  const double sigma_placement = std::sqrt(path.covariance(0, 0));
  std::vector<std::vector<std::string>> rows;
  if (tilt_known) {
    rows.push_back({"placement error x", "xe", si(path.placement.x(), "m"), si(sigma_placement, "m")});
    rows.push_back({"placement error y", "ye", si(path.placement.y(), "m"), si(sigma_placement, "m")});
    rows.push_back({"tilt from vertical", "90 deg - theta", number(path.tilt() / degree, 4) + " deg",
                    number(fit.tilt_sigma / degree) + " deg"});
    rows.push_back({"azimuth from x", "alpha", number(path.azimuth() / degree, 4) + " deg",
                    number(fit.azimuth_sigma / degree) + " deg"});
    report["tilt_rad"] = path.tilt();
    report["tilt_sigma_rad"] = fit.tilt_sigma;
    report["azimuth_rad"] = path.azimuth();
    report["azimuth_sigma_rad"] = fit.azimuth_sigma;
  } else {
    rows.push_back(
        {"offset x at this height", "", si(path.placement.x(), "m"), si(path.sigma(path.least_height), "m")});
    rows.push_back(
        {"offset y at this height", "", si(path.placement.y(), "m"), si(path.sigma(path.least_height), "m")});
  }
  add_field(path, fit, rows, report);
  if (std::isfinite(path.slowness_sigma)) {
    rows.push_back({"ejection speed", "u", si(1.0 / path.slowness, "m/s"),
                    si(path.slowness_sigma / (path.slowness * path.slowness), "m/s")});
    report["ejection_speed_m_s"] = 1.0 / path.slowness;
  }
  if (std::isfinite(path.delay_sigma)) {
    rows.push_back({"delay from trigger to droplet", "t0", si(path.delay, "s"), si(path.delay_sigma, "s")});
    report["delay_s"] = path.delay;
  }
  page.table({"parameter (table 5.2)", "symbol", "value", "1 sigma"}, rows);
  page.heading("Before and after, by height (table 5.3)");
  page.table({"height", "droplets", "before (RMS)", "after (RMS)", "improvement"},
             before_and_after(drops, fit));
  page.plots({scatter_plot(drops, fit, false), scatter_plot(drops, fit, true)});
  std::vector<double> sizes;
  for (Eigen::Index i = 0; i < drops.diameter.size(); ++i)
    if (fit.kept(i) > 0.0 && std::isfinite(drops.diameter(i))) sizes.push_back(drops.diameter(i));
  if (sizes.size() >= 8) {
    const auto statistics = metrology::droplet_statistics(
        Eigen::Map<const Eigen::VectorXd>(sizes.data(), static_cast<Eigen::Index>(sizes.size())));
    page.heading("Diameter (table 5.1)");
    page.table({"droplets", "mean", "standard error", "deviation", "within 1 sigma", "within 2 sigma",
                "Anderson-Darling"},
               {{std::to_string(statistics.count), si(statistics.mean, "m", 4),
                 si(statistics.mean_error, "m"), si(statistics.deviation, "m"),
                 number(100.0 * statistics.within_one) + " %", number(100.0 * statistics.within_two) + " %",
                 number(statistics.anderson_darling) + ", p = " + number(statistics.probability) +
                     (statistics.probability < 0.05 ? " (not normal)" : " (compatible with normal)")}});
    report["diameter"] = {{"count", statistics.count},
                          {"mean_m", statistics.mean},
                          {"deviation_m", statistics.deviation},
                          {"mean_error_m", statistics.mean_error},
                          {"within_one_sigma", statistics.within_one},
                          {"within_two_sigma", statistics.within_two},
                          {"anderson_darling", statistics.anderson_darling},
                          {"probability", statistics.probability}};
  }
  write_calibration(folder, text, report, page);

  std::cout << "droplet trajectory: " << line_of(left_out) << '\n';
  if (tilt_known)
    std::cout << "placement (" << si(path.placement.x(), "m") << ", " << si(path.placement.y(), "m")
              << ") +- " << si(sigma_placement, "m") << ", tilt " << number(path.tilt() / degree) << " +- "
              << number(fit.tilt_sigma / degree) << " deg, azimuth " << number(path.azimuth() / degree)
              << " +- " << number(fit.azimuth_sigma / degree) << " deg\n";
  std::cout << "RMS distance from the target " << si(fit.before_rms, "m") << " before, "
            << si(fit.after_rms, "m") << " after (to expect of new droplets)\n";
  if (fit.field_form != metrology::FieldForm::none)
    std::cout << "field turned by " << number(0.5 * (path.field(1, 0) - path.field(0, 1)) / degree)
              << " deg, scaled by " << number(1e6 * path.field(0, 0)) << " and "
              << number(1e6 * path.field(1, 1)) << " ppm along x and y\n";
  std::cout << left_words(fit) << '\n';
  for (const auto& note : fit.notes) std::cout << "note: " << note << '\n';
  for (const auto& what : fit.unidentified) std::cout << "not identified: " << what << '\n';
  std::cout << written(folder, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_dispenser(CLI::App& group) {
  struct Options {
    std::filesystem::path droplets;
    std::filesystem::path out;
  };
  auto* command = group.add_subcommand("dispenser", "Placement error and tilt of a droplet dispenser");
  command->footer("Example: invar calibrate dispenser --droplets droplets.csv --out result");
  auto options = std::make_shared<Options>();
  command
      ->add_option(
          "--droplets", options->droplets,
          "target_x/y [m], height [m], landed_x/y [m]; optional diameter [m], stage_velocity_x/y [m/s]")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->callback([options] { calibrate(options->droplets, options->out); });
}

recording::Table predict_dispenser(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  file.root()["identified_from"].accept_all();
  const metrology::DropletTrajectory path = compensation::read_trajectory(file.root());
  file.finish();
  const auto x = inputs.in("target_x", "m");
  const auto y = inputs.in("target_y", "m");
  const auto height = inputs.in("height", "m");
  const auto vx = inputs.optionally_in("stage_velocity_x", "m/s");
  const auto vy = inputs.optionally_in("stage_velocity_y", "m/s");
  expect_finite(inputs.file, "target_x", x, 1e3);
  expect_finite(inputs.file, "target_y", y, 1e3);
  expect_finite(inputs.file, "height", height, 1e3);
  std::vector<double> columns[5];
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Eigen::Vector2d velocity{vx ? (*vx)[i] : 0.0, vy ? (*vy)[i] : 0.0};
    const Eigen::Vector2d aimed = path.aim({x[i], y[i]}, height[i], velocity);
    const double values[] = {aimed.x(), aimed.y(), x[i] - aimed.x(), y[i] - aimed.y(),
                             path.sigma(height[i], aimed)};
    for (std::size_t k = 0; k < 5; ++k) columns[k].push_back(values[k]);
  }
  recording::Table output;
  const char* names[] = {"command_x", "command_y", "offset_x", "offset_y", "sigma"};
  for (std::size_t k = 0; k < 5; ++k) output.add(names[k], "m", std::move(columns[k]));
  return output;
}

}  // namespace invar::tools
