// `invar status`: how the processes and components of a running cell are.
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "tools/live/commands.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/status_view.hpp"

namespace invar::tools {

namespace {

struct Options {
  explicit Options(CLI::App& command) : call{command, {}} {}
  CellCall call;
  bool json = false;
};

int status(Options& options) {
  options.call.resolve();
  LiveCell cell{options.call};
  CellStatus status{
      .cell = cell.name(), .processes = {}, .components = {}, .missing = {}, .silent = {}, .notices = {}};
  if (cell.found()) {
    status.missing = cell.wait_for_processes();
    status.processes = cell.client().processes();
    status.components = cell.client().components();
    std::this_thread::sleep_for(
        std::chrono::milliseconds{100});  // what was said before arrives behind the state
    status.notices = cell.client().take_notices();
  }
  if (options.json)
    std::cout << to_json(status).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  else if (!status.processes.empty())
    print(status, std::cout);
  if (status.processes.empty()) cell.say_not_found("invar status");
  return status.healthy() ? 0 : 1;
}

}  // namespace

void add_status(CLI::App& program) {
  auto* command = program.add_subcommand("status", "Show how a running cell's processes and components are");
  command->footer(
      "Example: invar status deployment/xy-table.yaml\n"
      "         invar status --domain 71 --json\n"
      "Exit status: 0 all is well; 1 a process does not answer or has tripped, or a component is in error; 2 "
      "a "
      "fault of the call or the file");
  auto options = std::make_shared<Options>(*command);
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options] {
    if (const int result = status(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
