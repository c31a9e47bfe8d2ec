// `invar calibrate controller`: a geometric model in the forms that machine controllers read.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <set>
#include <sstream>
#include <string>

#include "core/base/new_file.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/rotary_file.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/geometric/controller_files.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

constexpr double worth_saying = 3e-8;  // m

struct CalibrateControllerOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  int nodes = 21;
};

void write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream stream = new_stream(file);
  stream << text;
  stream.close();
  if (!stream) throw InputError{file.string(), "cannot be written", "check the folder and the space left"};
  std::cout << file.string() << '\n';
}

/// Components that the lines left open, by the model's file.
std::set<std::string> unidentified_of(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  std::set<std::string> names;
  if (!yaml.root().has("identification") || !yaml.root()["identification"].has("unidentified")) return names;
  std::istringstream words{yaml.root()["identification"]["unidentified"].as_text()};
  for (std::string name; words >> name;) names.insert(name);
  return names;
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw InputError{folder.string(), "cannot be made", "name a folder that may be written to"};
}

void export_rotary(const CalibrateControllerOptions& options) {
  const auto axis = compensation::load_rotary(options.model);
  make_folder(options.out);
  const std::string letter(1, axis.letter);
  write(options.out / ("linuxcnc-" + letter + ".comp"), linuxcnc_compensation(axis));
  if (const double off = linuxcnc_difference(axis); off > worth_saying)
    std::cout << "  its 256 points are " << report::number(off * 206264.806, 3)
              << " arcsec off the model between them at most\n";
  if (axis.reversal.empty())
    std::cout << "  the axis was read in one direction: both columns hold that one\n";
  std::cout << "volcomp-isg.csv is not written: its grid has linear axes alone\n";
}

std::string kind_of(const std::filesystem::path& model) {
  const auto yaml = config::Yaml::load(model);
  return yaml.root().has("kind") ? yaml.root()["kind"].as_text() : "";
}

void export_model(const CalibrateControllerOptions& options) {
  if (kind_of(options.model) == "rotary") return export_rotary(options);
  const auto model = compensation::load_geometric(options.model);
  make_folder(options.out);
  const auto unidentified = unidentified_of(options.model);
  bool any = false;
  for (int axis = 0; axis < 3; ++axis) {
    if (!model.chain.has(axis)) continue;
    const std::string letter(1, metrology::axis_letters[static_cast<std::size_t>(axis)]);
    if (positioning_is_known(model, axis, unidentified)) {
      write(options.out / ("linuxcnc-" + letter + ".comp"), linuxcnc_compensation(model, axis));
      if (const double off = linuxcnc_difference(model, axis); off > worth_saying)
        std::cout << "  its 256 points are " << report::si(off, "m")
                  << " off the model between them at most\n";
      any = true;
    } else {
      std::cout << "linuxcnc-" << letter << ".comp is not written: no line told the positioning of " << letter
                << '\n';
    }
  }
  if (any) {
    write(options.out / "volcomp-isg.csv", isg_volumetric_csv(model, options.nodes, unidentified));
    if (std::any_of(model.reversal.begin(), model.reversal.end(),
                    [](const auto& curve) { return !curve.empty(); })) {
      write(options.out / "volcomp-isg-forward.csv",
            isg_volumetric_csv(model, options.nodes, unidentified, 1));
      write(options.out / "volcomp-isg-backward.csv",
            isg_volumetric_csv(model, options.nodes, unidentified, -1));
    }
  }
  write(options.out / "skew.txt", skew_numbers(model, unidentified));
}

}  // namespace

void add_calibrate_controller(CLI::App& group) {
  auto* command = group.add_subcommand("controller",
                                       "Write a geometric model in the forms that machine controllers read");
  command->footer(
      "Example: invar calibrate controller --model result/compensation.yaml --out controller\n"
      "Writes a grid for ISG and TwinCAT CNC (ISG_CSV): the mean of both directions. Where a reversal "
      "was\n"
      "measured, also one for all axes moving forward and one for backward. One COMP_FILE an axis for "
      "LinuxCNC\n"
      "(COMP_FILE_TYPE = 0) with both directions, and the squareness as numbers for skew parameters. A "
      "function that no "
      "line shows is left out,\n"
      "never zero. A rotary axis gives its COMP_FILE in degrees.");
  auto options = std::make_shared<CalibrateControllerOptions>();
  command->add_option("--model", options->model, "compensation.yaml of kind geometric or rotary")->required();
  command->add_option("--out", options->out, "folder to write to")->required();
  command->add_option("--nodes", options->nodes, "nodes an axis of the ISG grid")
      ->check(CLI::Range(2, 101))
      ->capture_default_str();
  command->callback([options] { export_model(*options); });
}

}  // namespace invar::tools
