// `invar lifecycle`: asks a running component, a process or the whole cell for a transition.
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/live/commands.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/status_view.hpp"

namespace invar::tools {

namespace {

struct LifecycleOptions {
  explicit LifecycleOptions(CLI::App& command)
      : call{command,
             {{"COMPONENT", "a component; or `all`, of --process or of the cell"},
              {"TRANSITION",
               "configure, activate, deactivate, cleanup, reset, shutdown, or stop (a process)"}}} {}
  CellCall call;
  std::string process;
  bool json = false;
};

struct Asked {
  std::string process, component;
  bool done = false;
  std::string state, text;
};

Asked ask(LiveCell& cell, const std::string& process, const std::string& component,
          lifecycle::Transition transition) {
  Asked asked{process, component, false, "", "no answer"};
  const auto reply = cell.client().request(process, component, transition, cell.patience());
  if (!reply) {
    asked.text += cell.clocks_apart(process);
    return asked;
  }
  return {process, component, reply->done(), state_text(reply->state()), reply->text().c_str()};
}

/// In the order that keeps the cell safe.
std::vector<std::string> processes_of(LiveCell& cell, lifecycle::Transition transition) {
  std::vector<std::string> names;
  if (cell.file() != nullptr) {
    for (const auto& process : cell.file()->processes) names.push_back(process.name);
  } else {
    cell.wait_for_processes();
    for (const auto& process : cell.client().processes()) names.emplace_back(process.process_name().c_str());
  }
  const bool up = transition == lifecycle::TRANSITION_CONFIGURE ||
                  transition == lifecycle::TRANSITION_ACTIVATE || transition == lifecycle::TRANSITION_RESET;
  // The file names what moves first and the recorder last: stopping goes in its order, bringing up against it.
  if (up) std::reverse(names.begin(), names.end());
  return names;
}

int run(LifecycleOptions& options) {
  options.call.resolve();
  const std::string& component = options.call.word(0);
  const auto transition = dds::parse_wire_transition(options.call.word(1));
  if (!transition)
    throw InputError{"TRANSITION", "`" + options.call.word(1) + "` is no transition",
                     "use configure, activate, deactivate, cleanup, reset, shutdown or stop"};
  const bool all = component == "all";
  if (*transition == lifecycle::TRANSITION_STOP_PROCESS && !all)
    throw InputError{"TRANSITION", "only processes are stopped",
                     "write `all stop`, with --process for one of them"};
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  std::vector<Asked> answers;
  if (all && options.process.empty()) {
    for (const auto& process : processes_of(cell, *transition))
      answers.push_back(ask(cell, process, "", *transition));
  } else {
    const std::string process = options.process.empty() ? cell.process_of(component) : options.process;
    if (process.empty()) {
      if (cell.file() != nullptr)
        throw InputError{"COMPONENT", "`" + component + "` is no component of " + cell.file()->file.string(),
                         "use a name below `components`, or `all`"};
      std::cerr << options.call.command << ": no process says that it has `" << component << "`\n";
      return 1;
    }
    answers.push_back(ask(cell, process, all ? "" : component, *transition));
  }
  auto json = nlohmann::ordered_json::array();
  bool good = !answers.empty();
  for (const Asked& answer : answers) {
    good = good && answer.done;
    const std::string who = answer.component.empty() ? answer.process : answer.component;
    if (options.json)
      json.push_back({{"process", answer.process},
                      {"component", answer.component},
                      {"done", answer.done},
                      {"state", answer.state},
                      {"text", answer.text}});
    else if (answer.done)
      std::cout << who << ": " << answer.state << '\n';
    else
      std::cerr << who << ": " << answer.text << '\n';
  }
  if (options.json) std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  return good ? 0 : 1;
}

}  // namespace

void add_lifecycle(CLI::App& program) {
  auto* command =
      program.add_subcommand("lifecycle", "Ask a running component, process or cell for a transition");
  command->footer(
      "Example: invar lifecycle deployment/xy-table.yaml stage_x deactivate\n"
      "         invar lifecycle deployment/xy-table.yaml all stop --process heat\n"
      "Exit status: 0 done; 1 refused or no answer; 2 a fault of the call or the file");
  auto options = std::make_shared<LifecycleOptions>(*command);
  command->add_option("--process", options->process, "the process that is meant, with `all`");
  command->add_flag("--json", options->json, "print the answers as JSON");
  command->callback([options] {
    if (const int result = run(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
