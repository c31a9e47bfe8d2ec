// `invar deploy`: a cell on all its PCs, by ssh: sent, checked, made current, started; or the release before.
#include <iostream>
#include <memory>
#include <string>

#include "core/base/name.hpp"
#include "tools/command.hpp"
#include "tools/commands/remote_options.hpp"
#include "tools/deploy/deployment.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct DeployCommand {
  DeployOptions deploy;
  std::string service = "systemd";
  bool roll_back = false, show = false, quiet = false;
};

int deploy(DeployCommand& options) {
  check_remote_options(options.deploy);
  options.deploy.service = options.service == "systemd";
  const Tell tell = [&](const std::string& line) {
    if (!options.quiet) std::cout << printable(line) << std::endl;
  };
  const HostFaults faults = options.show        ? show(options.deploy, tell)
                            : options.roll_back ? roll_back(options.deploy, tell)
                                                : tools::deploy(options.deploy, tell);
  for (const std::string& fault : faults) std::cerr << "invar deploy: " << printable_lines(fault) << '\n';
  return faults.empty() ? 0 : 1;
}

}  // namespace

void add_deploy(CLI::App& program) {
  auto* command =
      program.add_subcommand("deploy", "Bring a cell to all its PCs by ssh, or back to the release before");
  command->footer(
      "Example: invar deploy deployment/xy-table.yaml\n"
      "It sends this program with its libraries, the cell file, all files that it names, and a systemd unit "
      "a PC.\n"
      "Contents that a PC has already are not sent again. When each PC has checked the whole, all switch to "
      "it and\n"
      "start the cell. A running cell stops in order first. Where one PC fails, all get back what they had.\n"
      "In a secured cell each PC gets the keys of its own names, where the folder of the keys is on this "
      "PC.\n"
      "After an aborted call each PC has one whole release. The next call goes on from there.\n"
      "ssh asks no questions: its keys and the keys of the PCs must be there. The user on a PC is root, or "
      "may use\n"
      "sudo without a password; the cell's folder below --prefix is then of that user.\n"
      "Exit status: 0 done, 1 a PC or the cell failed, 2 the call or the file is wrong");
  auto options = std::make_shared<DeployCommand>();
  command->add_option("file", options->deploy.cell, "the cell file")->required();
  auto* back = command->add_flag("--roll-back", options->roll_back,
                                 "make the release before current again, on all PCs");
  command->add_flag("--show", options->show, "say which release each PC has, and change nothing")
      ->excludes(back);
  command
      ->add_option("--service", options->service, "systemd: install and start the service; none: files only")
      ->check(CLI::IsMember({"systemd", "none"}))
      ->capture_default_str();
  command
      ->add_option("--patience", options->deploy.patience,
                   "time for a service to start, and for the cell to be well [s]")
      ->check(positive())
      ->capture_default_str();
  add_remote_options(*command, options->deploy);
  command->add_flag("--quiet", options->quiet, "say only what failed");
  command->callback([options] {
    if (const int status = deploy(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools
