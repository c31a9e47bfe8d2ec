// `invar calibrate thermal`: the error of an axis over position, temperature and heating rate.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "core/compensation/thermal_file.hpp"
#include "core/metrology/geometric/error_motions.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/thermal/distortion.hpp"
#include "tools/thermal/thermal_page.hpp"

namespace invar::tools {

namespace {

using metrology::ThermalFit;
using metrology::ThermalReadings;
using report::number;
using report::si;

/// The columns as vectors; rows in which any of them is empty or nan are left out.
ThermalReadings read_readings(const recording::Table& table) {
  struct Wanted {
    const char* name;
    const char* unit;
    double largest;
  };
  static constexpr Wanted wanted[] = {{"x", "m", 1e3},         {"temperature", "degC", 1e4},
                                      {"error", "m", 1.0},     {"heating_rate", "K/s", 1e3},
                                      {"direction", "1", 1e3}, {"t", "s", 1e12}};
  constexpr std::size_t required = 3;
  std::vector<std::vector<double>> columns;
  std::vector<bool> complete(table.rows(), true);
  for (std::size_t k = 0; k < std::size(wanted); ++k) {
    columns.emplace_back();
    if (k >= required && !table.has(wanted[k].name)) continue;
    columns.back() = table.in(wanted[k].name, wanted[k].unit);
    std::size_t missing = 0;
    for (std::size_t i = 0; i < columns.back().size(); ++i)
      if (std::isnan(columns.back()[i])) {
        complete[i] = false;
        ++missing;
      }
    if (missing == table.rows())
      throw InputError{table.file.string() + ": column `" + wanted[k].name + "`",
                       "every value is empty or nan", "record the values"};
  }
  // Further thermistors: any column temperature_<zone>.
  std::vector<std::string> zones;
  std::vector<std::vector<double>> zone_columns;
  for (const auto& column : table.columns) {
    constexpr std::string_view prefix = "temperature_";
    if (!column.name.starts_with(prefix)) continue;
    zones.push_back(column.name.substr(prefix.size()));
    zone_columns.push_back(table.in(column.name, "degC"));
    expect_finite(table.file, column.name, zone_columns.back(), 1e4);
  }
  if (zones.size() > metrology::most_zones)
    throw InputError{table.file.string(),
                     "has " + std::to_string(zones.size()) + " columns temperature_<zone>; 4 at most",
                     "leave out those that matter least"};
  const auto kept = Eigen::Index{std::count(complete.begin(), complete.end(), true)};
  std::vector<Eigen::VectorXd> vectors;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    vectors.emplace_back(columns[k].empty() ? 0 : kept);
    Eigen::Index next = 0;
    for (std::size_t i = 0; i < columns[k].size(); ++i) {
      if (!complete[i]) continue;
      if (std::abs(columns[k][i]) > wanted[k].largest)
        throw InputError{
            table.file.string() + ": column `" + wanted[k].name + "`, row " + std::to_string(i + 1),
            number(columns[k][i], 6) + " is out of range", "check the value and its unit"};
      vectors[k](next++) = columns[k][i];
    }
  }
  ThermalReadings readings{vectors[0], vectors[1], vectors[2], std::nullopt, std::nullopt, std::nullopt, {}};
  readings.incomplete = complete.size() - static_cast<std::size_t>(kept);
  for (std::size_t z = 0; z < zones.size(); ++z) {
    Eigen::VectorXd values(kept);
    Eigen::Index next = 0;
    for (std::size_t i = 0; i < zone_columns[z].size(); ++i)
      if (complete[i]) values(next++) = zone_columns[z][i];
    readings.zones.push_back({zones[z], std::move(values)});
  }
  if (!columns[3].empty()) readings.heating_rate = vectors[3];
  if (!columns[4].empty()) readings.direction = vectors[4];
  if (!columns[5].empty()) readings.time = vectors[5];
  const std::string file = table.file.string();
  if (readings.x.size() < 8)
    throw InputError{file, "has too few rows (" + std::to_string(readings.x.size()) + "; 8 at least)",
                     "record more points over position and temperature"};
  if (readings.x.maxCoeff() - readings.x.minCoeff() < 1e-9)
    throw InputError{file + ": column `x`", "all points are at the same position", "record along the travel"};
  if (readings.time)
    for (Eigen::Index i = 1; i < readings.time->size(); ++i)
      if ((*readings.time)(i) < (*readings.time)(i - 1))
        throw InputError{file + ": column `t`, row " + std::to_string(i + 1), "time runs backwards",
                         "give the rows in the order of measurement"};
  return readings;
}

struct CalibrateThermalOptions {
  std::filesystem::path recording;
  std::filesystem::path out;
  std::string axis;
  std::filesystem::path above;
};

compensation::ThermalPlace place_of(const CalibrateThermalOptions& options) {
  compensation::ThermalPlace place;
  if (!options.axis.empty()) place.axis = metrology::axis_named(options.axis);
  if (options.above.empty()) return place;
  const auto below = config::Yaml::load(options.above);
  place.above = compensation::check_seal(below);
  if (place.above == 0 || below.root().text("kind") != "geometric")
    throw InputError{options.above.string(), "is no geometric model with a valid checksum",
                     "name the compensation.yaml that was active while the recording was made"};
  return place;
}

void calibrate(const CalibrateThermalOptions& options) {
  const std::filesystem::path& file = options.recording;
  const std::filesystem::path& folder = options.out;
  const compensation::ThermalPlace place = place_of(options);
  const auto table = recording::Table::read(file);
  const ThermalReadings readings = read_readings(table);
  const ThermalFit fit = [&] {
    const Progress progress{"identifying the surface over position and temperature"};
    return metrology::identify_thermal(readings);
  }();
  const ThermalFigures figures = thermal_figures(readings, fit);

  compensation::ModelText text{"thermal", {file}};
  compensation::write_place(text, place);
  compensation::write_thermal(text, fit.model);
  nlohmann::json report;
  report["kind"] = "thermal";
  report["readings"] = readings.x.size();
  report["rejected"] = figures.left_out.rows.size();
  report["in_stretches"] = fit.in_stretches;
  report["rows"] = report::json_of(figures.left_out);
  report["noise_m"] = fit.model.noise;
  report["before_rms_m"] = figures.before;
  report["after_left_out_rms_m"] = figures.after;
  report["mean_sigma_m"] = figures.sigma;
  report["reversal_m"] = fit.reversal;
  report["unidentified"] = fit.unidentified;
  report["notes"] = fit.notes;
  for (const auto& candidate : fit.candidates)
    report["models"].push_back({{"name", candidate.name},
                                {"log_evidence", candidate.log_evidence},
                                {"left_out_rms_m", candidate.left_out_rms},
                                {"held_out_passes_rms_m", candidate.held_out_rms},
                                {"lag_s", candidate.lag},
                                {"chosen", candidate.chosen},
                                {"verdict", candidate.verdict}});
  const Distortion distortion = distortion_of(readings, fit);
  if (!distortion.places.empty()) report["distortion"] = json_of(distortion);
  report::Page page = thermal_page(file, readings, fit, figures);
  show(page, distortion);
  write_calibration(folder, text, report, page);

  std::cout << "thermal error from " << readings.x.size() << " readings, noise " << si(fit.model.noise, "m")
            << '\n'
            << line_of(figures.left_out) << '\n';
  for (const auto& candidate : fit.candidates)
    std::cout << "  " << candidate.name << ": RMS " << si(candidate.left_out_rms, "m")
              << " on readings left out; " << candidate.verdict << '\n';
  std::cout << "RMS " << si(figures.before, "m") << " before, " << si(figures.after, "m")
            << " after (readings left out); systematic error known to " << si(figures.sigma, "m") << '\n';
  print(distortion, std::cout);
  for (const auto& what : fit.unexplained) std::cout << "not explained: " << what << '\n';
  for (const auto& note : fit.notes) std::cout << "note: " << note << '\n';
  for (const auto& what : fit.unidentified) std::cout << "not identified: " << what << '\n';
  std::cout << written(folder, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_thermal(CLI::App& group) {
  auto* command = group.add_subcommand("thermal", "Error over position, temperature and heating rate");
  command->footer(
      "Example: invar calibrate thermal --recording thermal.csv --out result\n"
      "With a column t, places that were read again and again get ranges in the form of ISO 230-3: in the "
      "first 60\n"
      "min and over the recording. Without gnuplot the report is written all the same; a sentence stands for "
      "each plot.");
  auto options = std::make_shared<CalibrateThermalOptions>();
  command
      ->add_option("--recording", options->recording,
                   "x [m], temperature [degC], error [m]; optional heating_rate [K/s], direction, t [s], and "
                   "for further "
                   "thermistors temperature_<zone> [degC]")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->add_option("--axis", options->axis, "x, y or z: for a machine that loads the model into its loop")
      ->check(CLI::IsMember({"x", "y", "z"}));
  command->add_option("--above", options->above,
                      "the geometric compensation.yaml that was active while the recording was made");
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_thermal(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  file.root()["identified_from"].accept_all();
  (void)compensation::read_place(file.root());
  const metrology::ThermalError model = compensation::read_thermal(file.root());
  file.finish();
  const auto x = inputs.in("x", "m");
  auto temperature = inputs.in("temperature", "degC");
  const auto rate = inputs.optionally_in("heating_rate", "K/s");
  std::vector<std::vector<double>> zones;
  for (const auto& zone : model.zones) {
    zones.push_back(inputs.in("temperature_" + zone.name, "degC"));
    expect_finite(inputs.file, "temperature_" + zone.name, zones.back(), 1e6);
  }
  expect_finite(inputs.file, "x", x, 1e6);
  expect_finite(inputs.file, "temperature", temperature, 1e6);
  if (rate) expect_finite(inputs.file, "heating_rate", *rate, 1e6);
  if (model.lag > 0.0) {
    // With a time column the lagged state is followed; otherwise a steady ramp is assumed.
    if (const auto time = inputs.optionally_in("t", "s")) {
      const Eigen::VectorXd lagged =
          metrology::lagged_temperature(vector_of(*time), vector_of(temperature), model.lag);
      temperature.assign(lagged.begin(), lagged.end());
    } else if (rate) {
      for (std::size_t i = 0; i < x.size(); ++i) temperature[i] -= model.lag * (*rate)[i];
    }
  }
  std::vector<double> error;
  std::vector<double> sigma;
  std::size_t outside = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    metrology::ThermalState at{x[i], temperature[i], rate ? (*rate)[i] : 0.0, {}};
    for (std::size_t z = 0; z < zones.size(); ++z) at.zones[z] = zones[z][i];
    error.push_back(model.value(at));
    sigma.push_back(model.sigma(at));
    outside += model.inside(at) ? 0U : 1U;
  }
  if (outside > 0)
    std::cerr << "warning: " << outside << " of " << x.size()
              << " points lie outside what was calibrated; the value at the end of the range is held there\n";
  recording::Table output;
  output.add("error", "m", std::move(error));
  output.add("sigma", "m", std::move(sigma));
  return output;
}

}  // namespace invar::tools
