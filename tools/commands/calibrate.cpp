// `invar calibrate`: the group; each kind is a file of its own.
#include "tools/commands/calibrate.hpp"

#include "tools/command.hpp"

namespace invar::tools {

void add_calibrate(CLI::App& program) {
  auto* group =
      program.add_subcommand("calibrate", "Identify an error from measurements and write its compensation");
  group->require_subcommand(1);
  add_calibrate_camera(*group);
  group->footer("Example: invar calibrate geometric --machine machine.yaml --lines lines.csv --out result");
  add_calibrate_dispenser(*group);
  add_calibrate_fusion(*group);
  add_calibrate_thermal(*group);
  add_calibrate_thermistor(*group);
  add_calibrate_geometric(*group);
  add_calibrate_plan(*group);
  add_calibrate_components(*group);
  add_calibrate_controller(*group);
  add_calibrate_ripple(*group);
  add_calibrate_history(*group);
}

}  // namespace invar::tools
