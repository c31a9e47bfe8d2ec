// `invar calibrate dispenser`: where droplets land that were aimed at their targets, and where to aim instead.
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>

#include "core/compensation/trajectory_file.hpp"
#include "core/metrology/droplet_trajectory.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/commands/calibration_result.hpp"

namespace invar::tools {

namespace {

using metrology::Droplets;
using metrology::TrajectoryFit;
using report::number;
using report::si;

constexpr double degree = std::numbers::pi / 180.0;

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
  report::Page page{"Dispenser calibration", file.filename().string() + ", " +
                                                 std::to_string(drops.height.size()) + " droplets, " +
                                                 std::to_string(rejected) + " rejected as satellites"};
  page.callout("Droplets land " + si(fit.before_rms, "m") + " from their targets (RMS), " +
                   si(fit.after_rms, "m") +
                   " after compensation; what is left is the scatter of single droplets",
               "good");
  for (const auto& what : fit.unidentified) page.callout("Not identified: " + what, "warn");
  for (const auto& note : fit.notes) page.paragraph(note);
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

  std::cout << "droplet trajectory from " << drops.height.size() << " droplets, " << rejected
            << " rejected as satellites\n";
  if (tilt_known)
    std::cout << "placement (" << si(path.placement.x(), "m") << ", " << si(path.placement.y(), "m")
              << ") +- " << si(sigma_placement, "m") << ", tilt " << number(path.tilt() / degree) << " +- "
              << number(fit.tilt_sigma / degree) << " deg, azimuth " << number(path.azimuth() / degree)
              << " +- " << number(fit.azimuth_sigma / degree) << " deg\n";
  std::cout << "RMS distance from the target " << si(fit.before_rms, "m") << " before, "
            << si(fit.after_rms, "m") << " after (to expect of new droplets, their scatter included)\n";
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
    const Eigen::Vector2d offset = path.offset(height[i], velocity);
    const double values[] = {x[i] - offset.x(), y[i] - offset.y(), offset.x(), offset.y(),
                             path.sigma(height[i])};
    for (std::size_t k = 0; k < 5; ++k) columns[k].push_back(values[k]);
  }
  recording::Table output;
  const char* names[] = {"command_x", "command_y", "offset_x", "offset_y", "sigma"};
  for (std::size_t k = 0; k < 5; ++k) output.add(names[k], "m", std::move(columns[k]));
  return output;
}

}  // namespace invar::tools
