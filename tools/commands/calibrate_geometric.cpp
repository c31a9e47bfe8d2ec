// `invar calibrate geometric`: displacement lines in, the machine's geometric error out.
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <string>

#include "core/compensation/geometric_file.hpp"
#include "core/machine/machine_file.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/commands/calibration_result.hpp"
#include "tools/geometric/geometric_report.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct Options {
  std::filesystem::path machine;
  std::filesystem::path lines;
  std::filesystem::path out;
  std::string method = "full";
  double interval = 0.0;
  bool study = false;
};

void calibrate(const Options& options) {
  GeometricResult result;
  result.machine_file = options.machine;
  result.lines_file = options.lines;
  result.method = options.method;
  result.machine = machine::load_machine(options.machine);
  result.input = read_lines(options.lines, result.machine, options.interval);
  metrology::IdentificationOptions how;
  how.method = options.method == "full" ? metrology::IdentificationMethod::full
                                        : metrology::IdentificationMethod::displacement;
  const bool watched = isatty(STDERR_FILENO) != 0;
  if (watched)
    how.progress = [](double part, const std::string& what) {
      std::cerr << "\r\033[K" << static_cast<int>(100.0 * part) << " % " << what << std::flush;
    };
  result.found = metrology::identify(result.machine, result.input.lines, how);
  if (watched) std::cerr << "\r\033[K" << std::flush;
  evaluate(result);
  if (options.study) study_intervals(result);

  compensation::ModelText text{"geometric", {options.machine, options.lines}};
  describe_identification(result, text);
  compensation::write_geometric(text, result.found.model);
  write_calibration(options.out, text, report_json(result), report_page(result));
  print_summary(result, std::cout);
  std::cout << "report: " << (options.out / "report.html").string() << '\n';
}

}  // namespace

void add_calibrate_geometric(CLI::App& group) {
  auto* command =
      group.add_subcommand("geometric", "Identify the geometric errors of a machine from displacement lines");
  command->footer(
      "Example: invar calibrate geometric --machine machine.yaml --lines lines.csv --out result\n"
      "Lines: name, commanded position and the laser's displacement, in the order of measurement; `invar "
      "calibrate\n"
      "plan` proposes which to measure.");
  auto options = std::make_shared<Options>();
  command->add_option("--machine", options->machine, "machine.yaml: chain, travel, tool")->required();
  command->add_option("--lines", options->lines, "readings of displacement lines, .csv or .csv.gz")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command
      ->add_option("--method", options->method,
                   "full: all lines at once; displacement: step by step as the seed method, corrected")
      ->check(CLI::IsMember({"full", "displacement"}))
      ->capture_default_str();
  command->add_option("--interval", options->interval, "use only readings at this interval along a line [m]")
      ->check(positive());
  command->add_flag("--interval-study", options->study, "also report the accuracy at coarser data intervals");
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_geometric(const config::Yaml& model_file, const recording::Table& inputs) {
  compensation::check_seal(model_file);
  (void)model_file.root().integer("invar_compensation", 1, 1);
  (void)model_file.root().text("kind");
  const auto model = compensation::read_geometric(model_file.root());
  model_file.finish();
  std::vector<Eigen::Vector3d> positions(inputs.rows(), Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> tools(inputs.rows(), model.tool);
  bool any = false;
  for (int k = 0; k < 3; ++k) {
    const std::string letter(1, metrology::axis_letters[static_cast<std::size_t>(k)]);
    const auto fill = [&](const std::string& name, std::vector<Eigen::Vector3d>& into) {
      const auto values = inputs.optionally_in(name, "m");
      for (std::size_t i = 0; values && i < values->size(); ++i) into[i][k] = (*values)[i];
      return values.has_value();
    };
    any = fill(letter, positions) || any;
    (void)fill("tool_" + letter, tools);
  }
  if (!any) (void)inputs.in("x", "m");  // says what is missing
  const auto temperature = inputs.optionally_in("temperature", "degC");
  if (temperature && !model.reference_temperature)
    std::cerr
        << model_file.file().string()
        << ": was calibrated without temperatures; the column `temperature` of the inputs changes nothing\n";
  recording::Table result;
  std::array<std::vector<double>, 6> columns;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    Eigen::Vector3d error = model.error(positions[i], tools[i]);
    Eigen::Vector3d sigma = model.sigma_at(positions[i], tools[i]);
    bool known = positions[i].allFinite() && tools[i].allFinite();
    if (temperature && model.reference_temperature) {
      known = known && std::isfinite((*temperature)[i]);
      error += model.expansion_at(positions[i], (*temperature)[i]);
      const Eigen::Vector3d more = model.expansion_sigma_at(positions[i], (*temperature)[i]);
      sigma = (sigma.cwiseAbs2() + more.cwiseAbs2()).cwiseSqrt();
    }
    for (int k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(k);
      columns[c].push_back(known ? error[k] : std::numeric_limits<double>::quiet_NaN());
      columns[c + 3].push_back(known ? sigma[k] : std::numeric_limits<double>::infinity());
    }
  }
  const std::array<const char*, 6> names{"error_x", "error_y", "error_z", "sigma_x", "sigma_y", "sigma_z"};
  for (std::size_t c = 0; c < 6; ++c) result.add(names[c], "m", std::move(columns[c]));
  return result;
}

}  // namespace invar::tools
