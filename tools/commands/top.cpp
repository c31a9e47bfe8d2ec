// `invar top`: the state of a running cell and the rates of its topics, again and again.
#include <unistd.h>

#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/silence.hpp"
#include "tools/live/status_view.hpp"
#include "tools/live/terminal.hpp"
#include "tools/live/text_table.hpp"
#include "tools/live/topic_json.hpp"
#include "tools/live/topic_watch.hpp"

namespace invar::tools {

namespace {

struct TopOptions {
  explicit TopOptions(CLI::App& command) : call{command, {}} {}
  CellCall call;
  double interval = 1.0;
  bool once = false;
  bool json = false;
  bool no_topics = false;
};

/// Counts of one look and of the look before.
struct Looks {
  std::map<std::string, Flows> now, before;
  std::int64_t now_ns = 0;

  void next(const TopicWatch& watch) {
    before = std::exchange(now, watch.flows());
    now_ns = wall_clock_ns();
  }
};

void show(const CellStatus& status, const Looks& looks, bool topics, std::ostream& out) {
  print(status, out);
  if (!topics) return;
  TextTable table{{"topic", "rate [Hz]>", "kB/s>", "missing>"}};
  for (const auto& [topic, flows] : looks.now) {
    const auto before = looks.before.find(topic);
    const Flow::Rate rate =
        rate_of(flows, before == looks.before.end() ? Flows{} : before->second, looks.now_ns);
    std::uint64_t missing = 0;
    for (const auto& [writer, flow] : flows) missing += flow.missing;
    table.add({topic, number_text(rate.samples), number_text(rate.bytes * 1e-3), std::to_string(missing)});
  }
  out << '\n';
  table.print(out);
}

constexpr std::ptrdiff_t notices_kept = 20;

int top(TopOptions& options) {
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  CellStatus status;
  status.cell = cell.name();
  status.secured = cell.is_secured();
  if (cell.found()) status.missing = cell.wait_for_processes();
  if (!cell.found() || cell.client().processes().empty()) {
    cell.say_not_found("invar top");
    return 1;
  }
  TopicWatch watch{cell.node(), [&](const std::string& topic) {
                     return !options.no_topics && topic.starts_with("cell/" + cell.name() + "/") &&
                            !is_service_topic(topic);
                   }};
  if (!options.no_topics) cell.settle();  // so that the first look finds all of them
  watch.look();
  const auto asked = std::chrono::steady_clock::now();
  while (!watch.hears_all() &&
         std::chrono::steady_clock::now() - asked < std::chrono::nanoseconds{cell.patience().ns} &&
         sleep_for(Duration::milliseconds(20))) {
  }
  Looks looks;
  Silence silence;
  const bool screen = isatty(STDOUT_FILENO) != 0 && !options.once && !options.json;
  do {
    if (!sleep_for(Duration::seconds(options.interval))) break;
    status.processes = cell.client().processes();
    status.components = cell.client().components();
    for (auto& notice : cell.client().take_notices()) status.notices.push_back(std::move(notice));
    if (std::ssize(status.notices) > notices_kept)
      status.notices.erase(status.notices.begin(), status.notices.end() - notices_kept);
    status.silent = silence.of(status.processes);
    std::erase_if(status.missing, [&](const std::string& name) {
      return std::any_of(status.processes.begin(), status.processes.end(),
                         [&](const auto& p) { return name == p.process_name().c_str(); });
    });
    looks.next(watch);
    if (options.json) {
      auto json = to_json(status);
      json["topics"] = nlohmann::ordered_json::array();
      const auto snapshot = cell.node().snapshot();
      for (const auto& [topic, flows] : looks.now)
        json["topics"].push_back(json_of(topic, snapshot, flows, looks.before[topic], looks.now_ns));
      std::cout << json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
    } else {
      std::ostringstream text;
      show(status, looks, !options.no_topics, text);
      // Home, the text, and what is left of an earlier longer one cleared line by line: no flicker.
      if (screen) steer(std::cout, go_home);
      std::istringstream lines{text.str()};
      for (std::string line; std::getline(lines, line);) {
        std::cout << line;
        if (screen) steer(std::cout, clear_to_line_end);
        std::cout << '\n';
      }
      if (screen) steer(std::cout, clear_below);
      std::cout << (screen || options.once ? "" : "\n") << std::flush;
    }
    watch.look();
  } while (!options.once && !interrupted());
  return options.once && !status.healthy() ? 1 : 0;
}

}  // namespace

void add_top(CLI::App& program) {
  auto* command =
      program.add_subcommand("top", "Watch a running cell: states, loops, latencies, topic rates");
  command->footer(
      "Example: invar top deployment/xy-table.yaml\n"
      "         invar top --domain 71 --once --no-topics\n"
      "Ctrl-C ends it. Rates are those of the time between two looks, by the times at which a topic's "
      "writers "
      "sent.\nThey are counted by reading the topics, which costs the cell's network that much.\n"
      "Exit status: 0; 1 no cell answers, or with --once something is not well; 2 a fault of the call or the "
      "file");
  auto options = std::make_shared<TopOptions>(*command);
  command->add_option("--interval", options->interval, "between two looks [s] (1)")
      ->check(CLI::Range(0.05, 3600.0));
  command->add_flag("--once", options->once, "one look, then end");
  command->add_flag("--no-topics", options->no_topics, "leave the topics alone");
  command->add_flag("--json", options->json, "one JSON object a look");
  command->callback([options] {
    if (const int result = top(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
