// `invar status`: how the processes and components of a running cell are.
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "tools/live/commands.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/status_view.hpp"

namespace invar::tools {

namespace {

struct StatusOptions {
  explicit StatusOptions(CLI::App& app) : call{app, {}}, command{app} {}
  CellCall call;
  CLI::App& command;
  bool json = false;
};

/// What was said before arrives behind the state of the processes, one after the other: silence means that all is there. Writers
/// that a reader is not yet connected to repeat their offer each 5 ms.
std::vector<event::Notice> hear_notices(LiveCell& cell) {
  using Clock = std::chrono::steady_clock;
  constexpr auto silence = std::chrono::milliseconds{30}, longest = std::chrono::milliseconds{100};
  std::vector<event::Notice> notices;
  const auto began = Clock::now();
  auto heard = began;
  for (std::size_t known = 0; Clock::now() - heard < silence && Clock::now() - began < longest;) {
    for (auto& notice : cell.client().take_notices()) notices.push_back(std::move(notice));
    const std::size_t now = notices.size() + cell.client().components().size();
    if (now != known) heard = Clock::now();
    known = now;
    std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  return notices;
}

int status(StatusOptions& options) {
  options.call.resolve();
  LiveCell cell{options.call};
  CellStatus status;
  status.cell = cell.name();
  status.secured = cell.is_secured();
  if (cell.found()) {
    status.missing = cell.wait_for_processes();
    cell.wait_for_restarts();
    status.notices = hear_notices(cell);
    if (options.command.count("--wait") > 0) cell.wait_for_components();
    status.processes = cell.client().processes();
    status.components = cell.client().components();
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
      "Exit status: 0 all is well; 1 a process does not answer or has tripped, or a component is in error or "
      "not active; 2 "
      "a "
      "fault of the call or the file");
  auto options = std::make_shared<StatusOptions>(*command);
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options] {
    if (const int result = status(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
