// `invar calibrate components`: error motions that were measured one by one, at several states of the machine.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/index.hpp"
#include "core/compensation/component_file.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric/geometric_field.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/geometric/components_file.hpp"
#include "tools/geometric/components_page.hpp"
#include "tools/geometric/field_points.hpp"
#include "tools/geometric/motion_figures.hpp"

namespace invar::tools {

namespace {

using metrology::error_motion_count;
using metrology::is_rotation;
using report::si;

struct CalibrateComponentsOptions {
  std::filesystem::path machine;
  std::filesystem::path readings;
  std::filesystem::path out;
  std::vector<std::string> tolerances;
  double device = 0.0;
  double environment = 0.0;
};

/// The reversal of a positioning goes to the model, and out of the readings that the network is fitted to.
metrology::ErrorMotionReadings without_reversal(ComponentsResult& result, int component) {
  const metrology::ErrorMotionReadings& readings = *result.readings[index(component)];
  if (readings.direction.empty() || !metrology::is_positioning(component)) return readings;
  const int axis = metrology::axis_of(component);
  metrology::ReversalCurve& curve = result.model.reversal[index(axis)];
  curve = metrology::reversal_of_readings(readings.position, readings.value, readings.direction,
                                          result.model.travel[index(axis)]);
  return metrology::without_reversal(readings, curve);
}

/// ISO names of what no reading told: components of the machine's axes, and squareness.
std::vector<std::string> not_measured(const metrology::ErrorMotionNetworks& model) {
  std::vector<std::string> names;
  for (int c = 0; c < error_motion_count; ++c)
    if (model.chain.has(metrology::axis_of(c)) && !model.components[index(c)])
      names.emplace_back(metrology::iso_name(c));
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (model.chain.has(a) && model.chain.has(b) &&
          model.squareness_sigma[index(metrology::squareness_of(a, b))] <= 0.0)
        names.emplace_back(metrology::squareness_iso_name(metrology::squareness_of(a, b)));
  return names;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// What is missing, and what the whole field amounts to.
void evaluate(ComponentsResult& result) {
  const auto& model = result.model;
  result.unidentified = not_measured(model);
  for (int c = 0; c < error_motion_count; ++c) {
    if (!model.chain.has(metrology::axis_of(c)) || !result.fits[index(c)]) continue;
    const Range travel = model.travel[index(metrology::axis_of(c))];
    const Range known = result.fits[index(c)]->motion.network.range[0];
    if (known.width() < 0.9 * travel.width())
      result.notes.push_back(std::string{metrology::iso_name(c)} + " was measured from " +
                             si(known.lower, "m") + " to " + si(known.upper, "m") +
                             " only: its end values are held beyond");
  }
  std::vector<double> usual;
  for (const auto& state : model.states) usual.push_back(state.usual());
  const auto grid = metrology::volume_grid(model.chain, model.travel, 9);
  for (const auto& point : grid) {
    result.field_rms +=
        model.error(point, model.tool, usual).squaredNorm() / static_cast<double>(grid.size());
    result.field_sigma +=
        model.sigma_at(point, model.tool, usual).squaredNorm() / static_cast<double>(grid.size());
  }
  result.field_rms = std::sqrt(result.field_rms);
  result.field_sigma = std::sqrt(result.field_sigma);
}

/// A state that no component depends on is none of the model: whoever uses that need not know it.
void drop_unused_states(ComponentsResult& result) {
  std::vector<std::size_t> kept;
  for (std::size_t s = 0; s < result.model.states.size(); ++s)
    if (std::any_of(result.fits.begin(), result.fits.end(), [s](const auto& fit) {
          return fit && std::find(fit->motion.states.begin(), fit->motion.states.end(), s) !=
                            fit->motion.states.end();
        }))
      kept.push_back(s);
  std::vector<metrology::MachineState> states;
  for (const std::size_t s : kept) states.push_back(result.model.states[s]);
  result.model.states = std::move(states);
  for (int c = 0; c < error_motion_count; ++c) {
    auto& fit = result.fits[index(c)];
    if (!fit) continue;
    Eigen::MatrixXd& readings = result.readings[index(c)]->state;
    readings = Eigen::MatrixXd{readings(kept, Eigen::all)};
    for (std::size_t& state : fit->motion.states)
      state = static_cast<std::size_t>(std::find(kept.begin(), kept.end(), state) - kept.begin());
    result.model.components[index(c)] = fit->motion;
  }
}

/// Figures of a motion's targets by ISO 230-2. Of a straightness only what no alignment of the straightedge changes.
std::optional<PositioningTest> test_of_motion(const ComponentsResult& result, int component,
                                              const CalibrateComponentsOptions& options) {
  const bool along = metrology::is_positioning(component);
  const bool turns = is_rotation(component);
  const metrology::Iso230Conditions conditions{along ? options.device : 0.0,
                                               turns ? 0.0 : options.environment};
  auto test = test_of("", targets_of(*result.readings[index(component)]), conditions);
  if (!test) return test;
  test->motion = metrology::iso_name(component);
  test->unit = turns ? "rad" : "m";
  if (!along && !turns)
    for (std::size_t f = static_cast<std::size_t>(metrology::Iso230Figure::E_forward);
         f < metrology::iso230_figures; ++f)
      test->figures.values[f] = test->figures.uncertainty[f] = std::nan("");
  return test;
}

/// Figures by ISO 230-1 and -2 of every motion that depends on its position alone.
void test_motions(ComponentsResult& result, const CalibrateComponentsOptions& options) {
  result.motions = motion_figures(result.readings, result.fits, result.model, options.environment);
  for (int c = 0; c < error_motion_count; ++c) {
    if (!result.fits[index(c)]) continue;
    if (!result.fits[index(c)]->motion.states.empty()) {
      result.notes.push_back(std::string{metrology::iso_name(c)} + " depends on " + result.depends_on(c) +
                             ": no figures of ISO 230, which are of one state");
      continue;
    }
    if (auto test = test_of_motion(result, c, options)) result.tests.push_back(std::move(*test));
  }
  result.not_judged = unmet(result.tolerances, result.tests, result.motions);
}

nlohmann::json report_of(const ComponentsResult& result) {
  nlohmann::json report;
  report["kind"] = "components";
  report["readings"] = result.rows;
  report["field_rms_m"] = result.field_rms;
  report["field_sigma_m"] = result.field_sigma;
  report["rows"] = report::json_of(rows_of(result));
  report["unidentified"] = result.unidentified;
  report["notes"] = result.notes;
  report["not_judged"] = result.not_judged;
  report["positioning"] = positioning_json(result.tests, result.tolerances);
  report["motions"] = motions_json(result.motions, result.tolerances);
  report["components"] = nlohmann::json::array();
  for (int c = 0; c < error_motion_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    nlohmann::json depends = nlohmann::json::array();
    for (const std::size_t state : fit.motion.states) depends.push_back(result.model.states[state].name);
    if (const auto& curve = result.model.reversal[index(metrology::axis_of(c))];
        metrology::is_positioning(c) && !curve.empty())
      report["reversal"][std::string(1, metrology::axis_letters[index(metrology::axis_of(c))])] = {
          {"mean", curve.mean()}, {"unit", "m"}};
    report["components"].push_back({{"name", metrology::iso_name(c)},
                                    {"unit", is_rotation(c) ? "rad" : "m"},
                                    {"depends_on", depends},
                                    {"readings", fit.kept.size()},
                                    {"rejected", fit.rejected},
                                    {"rms_used", rms_of_readings(fit, false)},
                                    {"rms_all", rms_of_readings(fit, true)},
                                    {"left_out_rms", fit.left_out},
                                    {"left_out_rms_position_alone", fit.over_position},
                                    {"sigma", fit.motion.sigma}});
  }
  return report;
}

void calibrate(const CalibrateComponentsOptions& options) {
  const metrology::Machine machine = machine::load_machine(options.machine);
  ComponentsResult result;
  result.machine_file = options.machine;
  result.readings_file = options.readings;
  result.model.chain = machine.chain;
  result.model.travel = machine.travel;
  result.model.tool = machine.tool;
  result.tolerances = read_tolerances(options.tolerances, false);
  read_components_file(options.readings, machine, result);
  {
    const Progress progress{"fitting the error motions"};
    for (int c = 0; c < error_motion_count; ++c) {
      if (!result.readings[index(c)]) continue;
      result.fits[index(c)] = metrology::identify_error_motion(without_reversal(result, c));
    }
    drop_unused_states(result);
  }
  evaluate(result);
  test_motions(result, options);
  compensation::ModelText text{"components", {options.machine, options.readings}};
  compensation::write_components(text, result.model);
  write_calibration(options.out, text, report_of(result), components_page(result));

  for (int c = 0; c < error_motion_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    const char* unit = is_rotation(c) ? "rad" : "m";
    std::cout << metrology::iso_name(c) << ": " << fit.kept.size() << " readings, " << fit.rejected
              << " rejected; by " << result.depends_on(c) << "; readings left out met to "
              << si(fit.left_out, unit) << "; error " << si(rms_of_readings(fit, false), unit)
              << " RMS over those used, " << si(rms_of_readings(fit, true), unit) << " over all\n";
  }
  for (int k = 0; k < 3; ++k)
    if (const auto& curve = result.model.reversal[index(k)]; !curve.empty())
      std::cout << "reversal of " << metrology::axis_letters[index(k)] << ": " << si(curve.mean(), "m")
                << " in the mean over the travel\n";
  print_motions(result.motions, result.tolerances, false, std::cout);
  print_positioning(result.tests, result.tolerances, std::cout);
  std::cout << "error over the travels " << si(result.field_rms, "m") << " RMS, known to "
            << si(result.field_sigma, "m") << '\n';
  for (const auto& what : result.not_judged) std::cout << "note: " << what << '\n';
  for (const auto& note : result.notes) std::cout << "note: " << note << '\n';
  if (!result.unidentified.empty())
    std::cout << "not measured, taken as zero: " << joined(result.unidentified) << '\n';
  std::cout << written(options.out, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_components(CLI::App& group) {
  auto* command =
      group.add_subcommand("components", "Error motions measured one by one, over position and temperature");
  command->footer(
      "Example: invar calibrate components --machine machine.yaml --readings components.csv --out result\n"
      "Rows: component (EXX .. ECZ, or EC0Y, EB0Z, EA0Z without a position), position [m] of its axis, "
      "translation [m]\n"
      "or rotation [rad]. Optional: direction (1, -1) for the reversal, and inputs: temperature [degC],\n"
      "heating_rate [K/s], temperature_<zone> [degC].\n"
      "Targets read more than once get the figures of ISO 230-2; straightness, angles and squareness those "
      "of ISO "
      "230-1.\n"
      "Tolerances: \"A=10 um\" of every positioning, \"ECX:R=2 arcsec\" of one motion, \"EYX=3 um\" of its "
      "figure by ISO "
      "230-1.\n"
      "From displacement lines alone: invar calibrate geometric.");
  auto options = std::make_shared<CalibrateComponentsOptions>();
  command->add_option("--machine", options->machine, "machine.yaml: chain, travel, tool")->required();
  command
      ->add_option("--readings", options->readings,
                   "readings of an angular interferometer, level or straightedge, .csv or .csv.gz")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->add_option("--tolerance", options->tolerances,
                      "a figure and its limit, \"A=10 um\" or \"EYX=3 um\": the report says pass or fail");
  command
      ->add_option(
          "--device", options->device,
          "standard uncertainty of the laser's scale, its alignment and the axis' temperature [of 1]")
      ->check(CLI::Range(0.0, 1e-2));
  command
      ->add_option("--environment", options->environment,
                   "standard uncertainty of what the surroundings move a reading of a length by [m]")
      ->check(CLI::Range(0.0, 1e-2));
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_components(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  const auto model = compensation::read_components(file.root());
  file.finish();
  if (const auto missing = not_measured(model); !missing.empty())
    std::cerr << "warning: not measured, taken as zero and not in sigma: " << joined(missing) << '\n';
  const FieldPoints points = read_points(inputs, model.tool);
  std::vector<std::vector<double>> columns;
  for (const auto& state : model.states) columns.push_back(inputs.in(state.name, unit_of_state(state.name)));
  std::vector<FieldValue> values;
  std::size_t outside = 0;
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    std::vector<double> state;
    for (const auto& column : columns) state.push_back(column[i]);
    const bool known = points.positions[i].allFinite() && points.tools[i].allFinite() &&
                       std::all_of(state.begin(), state.end(), [](double s) { return std::isfinite(s); });
    outside += known && !model.knows(state) ? 1U : 0U;
    const Eigen::Vector3d& moving = points.moving[i];
    values.push_back(
        known ? FieldValue{model.error(points.positions[i], points.tools[i], state) +
                               model.reversal_at(points.positions[i], moving),
                           (model.sigma_at(points.positions[i], points.tools[i], state).cwiseAbs2() +
                            model.reversal_sigma_at(points.positions[i], moving).cwiseAbs2())
                               .cwiseSqrt()}
              : unknown_value());
  }
  if (outside > 0)
    std::cerr << "warning: " << outside << " of " << values.size()
              << " points lie outside what was calibrated; the value at the end of the range is held there\n";
  return field_table(values);
}

}  // namespace invar::tools
