// `invar calibrate KIND`: the subcommand of each kind.
#pragma once

#include <CLI/CLI.hpp>

namespace invar::tools {

// One file each: tools/commands/calibrate_KIND.cpp. The first adds the subcommand to the group.
void add_calibrate_dispenser(CLI::App& group);
void add_calibrate_fusion(CLI::App& group);
void add_calibrate_thermal(CLI::App& group);
void add_calibrate_thermistor(CLI::App& group);
void add_calibrate_geometric(CLI::App& group);
void add_calibrate_plan(CLI::App& group);
void add_calibrate_controller(CLI::App& group);
void add_calibrate_components(CLI::App& group);
void add_calibrate_camera(CLI::App& group);
void add_calibrate_ripple(CLI::App& group);
void add_calibrate_history(CLI::App& group);

}  // namespace invar::tools
