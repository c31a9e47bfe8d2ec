// `invar calibrate geometric`: displacement lines in, the machine's geometric error out.
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/compensation/geometric_file.hpp"
#include "core/machine/machine_file.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/geometric/field_points.hpp"
#include "tools/geometric/geometric_report.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/geometric/rotary.hpp"
#include "tools/geometric/rotary_readings.hpp"
#include "tools/live/terminal.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct CalibrateGeometricOptions {
  std::filesystem::path machine;
  std::filesystem::path lines;
  std::filesystem::path out;
  std::string method = "full";
  double interval = 0.0;
  bool study = false;
  std::vector<std::string> tolerances;
  double device = 0.0;
  double environment = -1.0;
};

void calibrate(const CalibrateGeometricOptions& options) {
  if (const std::string axis = rotary_axis(options.machine); !axis.empty())
    return calibrate_rotary({options.machine, options.lines, options.out, axis, options.tolerances,
                             options.device, std::max(options.environment, 0.0)});
  GeometricResult result;
  result.tolerances = read_tolerances(options.tolerances, false);
  result.machine_file = options.machine;
  result.lines_file = options.lines;
  result.method = options.method;
  result.machine = machine::load_machine(options.machine, 1);
  result.input = read_lines(options.lines, result.machine, options.interval);
  metrology::IdentificationOptions how;
  how.method = options.method == "full" ? metrology::IdentificationMethod::full
                                        : metrology::IdentificationMethod::displacement;
  const bool watched = isatty(STDERR_FILENO) != 0;
  if (watched)
    how.progress = [](double part, const std::string& what) {
      steer(std::cerr, clear_line);
      std::cerr << static_cast<int>(100.0 * part) << " % " << what << std::flush;
    };
  result.found = metrology::identify(result.machine, result.input.lines, how);
  if (watched) steer(std::cerr, clear_line);
  evaluate(result);
  test_positioning(result, options.device, options.environment);
  if (options.study) study_intervals(result);

  compensation::ModelText text{"geometric", {options.machine, options.lines}};
  describe_identification(result, text);
  compensation::write_geometric(text, result.found.model);
  write_calibration(options.out, text, report_json(result), report_page(result));
  print_summary(result, std::cout);
  std::cout << written(options.out, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_geometric(CLI::App& group) {
  auto* command =
      group.add_subcommand("geometric", "Identify the geometric errors of a machine from displacement lines");
  command->footer(
      "Example: invar calibrate geometric --machine machine.yaml --lines lines.csv --out result\n"
      "Lines have one row a reading, in the order of measurement. Columns: line (its name), x [m], y [m], z "
      "[m]\n"
      "(commanded), displacement [m]: the whole way along the beam, 0 at the line's start, not its error.\n"
      "Optional: cycle, direction (1 or -1), temperature [degC], tool_x [m] ... [mm], [um], ... are "
      "converted.\n"
      "`invar calibrate plan` proposes which to measure.\n"
      "Instead of displacement: deviation [um] (reading minus nominal), or Renishaw's .rtl or .pos.\n"
      "Lines with several readings at each target also get the figures of ISO 230-2 (A, R, E, M, B).\n"
      "Diagonals get those of ISO 230-6.\n"
      "\n"
      "machine.yaml, the chain in the order of motion from the workpiece:\n"
      "  invar_machine: 1\n"
      "  chain: [y, x, z]\n"
      "  travel: {x: [0, 0.2], y: [0, 0.2], z: [-0.1, 0]}   # m; two axes for an XY table\n"
      "  tool: {x: 0, y: 0, z: -0.05}                       # m, from the last axis to the reflector; "
      "optional\n"
      "One axis: chain: [x]. A rotary one, chain: [c] (or a, b): columns c [deg] and deviation [arcsec]; "
      "travel\n"
      "{c: {interval: [0, 360], unit: deg}}. Over a whole turn its model comes round; deviations.csv has "
      "the\n"
      "means by target.");
  auto options = std::make_shared<CalibrateGeometricOptions>();
  command->add_option("--machine", options->machine, "machine.yaml: chain, travel, tool")->required();
  command->add_option("--lines", options->lines, "readings of displacement lines, .csv or .csv.gz")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command
      ->add_option("--method", options->method,
                   "full: all lines at once; displacement: step by step as in the thesis, corrected")
      ->check(CLI::IsMember({"full", "displacement"}))
      ->capture_default_str();
  command->add_option("--interval", options->interval, "use only readings at this interval along a line [m]")
      ->check(positive());
  command->add_option(
      "--tolerance", options->tolerances,
      "a figure and its limit, \"A=10 um\" or \"EYX=3 um\" (straightness): the report says pass or fail");
  command
      ->add_option(
          "--device", options->device,
          "standard uncertainty of the instrument's scale, its alignment and the axis' temperature [of 1]")
      ->check(CLI::Range(0.0, 1e-2));
  command
      ->add_option(
          "--environment", options->environment,
          "standard uncertainty of what the surroundings move a reading by [m, rad]; without it the drift "
          "at one point gives it")
      ->check(CLI::Range(0.0, 1e-2));
  command->add_flag("--interval-study", options->study, "also report the accuracy at coarser data intervals");
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_geometric(const config::Yaml& model_file, const recording::Table& inputs) {
  compensation::check_seal(model_file);
  (void)model_file.root().integer("invar_compensation", 1, 1);
  (void)model_file.root().text("kind");
  const auto model = compensation::read_geometric(model_file.root());
  model_file.finish();
  const FieldPoints points = read_points(inputs, model.tool);
  const auto temperature = inputs.optionally_in("temperature", "degC");
  if (temperature && !model.reference_temperature)
    std::cerr
        << model_file.file().string()
        << ": was calibrated without temperatures; the column `temperature` of the inputs changes nothing\n";
  std::vector<FieldValue> values;
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    const Eigen::Vector3d& position = points.positions[i];
    const Eigen::Vector3d& tool = points.tools[i];
    const bool warmed = temperature && model.reference_temperature;
    if (!position.allFinite() || !tool.allFinite() || (warmed && !std::isfinite((*temperature)[i]))) {
      values.push_back(unknown_value());
      continue;
    }
    FieldValue value{model.error(position, tool) + model.reversal_at(position, points.moving[i]),
                     (model.sigma_at(position, tool).cwiseAbs2() +
                      model.reversal_sigma_at(position, points.moving[i]).cwiseAbs2())
                         .cwiseSqrt()};
    if (warmed) {
      value.error += model.expansion_at(position, (*temperature)[i]);
      const Eigen::Vector3d more = model.expansion_sigma_at(position, (*temperature)[i]);
      value.sigma = (value.sigma.cwiseAbs2() + more.cwiseAbs2()).cwiseSqrt();
    }
    values.push_back(value);
  }
  return field_table(values);
}

}  // namespace invar::tools
