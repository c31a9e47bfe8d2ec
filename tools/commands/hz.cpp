// `invar hz`: how often a topic's samples come, how evenly, and how many are missing.
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"
#include "tools/live/topic_json.hpp"
#include "tools/live/topic_watch.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct HzOptions {
  explicit HzOptions(CLI::App& command)
      : call{command, {{"TOPIC", "a topic's full name, or component.port"}}} {}
  CellCall call;
  double duration = 0.0, interval = 2.0;
  bool json = false;
};

void print_flow(LiveCell& cell, const TopicWatch& watch, const std::string& topic, bool json) {
  const auto flows = watch.flows();
  const auto found = flows.find(topic);
  if (found == flows.end()) return;
  const auto snapshot = cell.node().snapshot();
  if (json) {
    const auto shape = json_of(topic, snapshot, found->second, {}, wall_clock_ns());
    std::cout << shape.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
    return;
  }
  TextTable table{{"writer", "samples>", "rate [Hz]>", "mean [ms]>", "deviation [ms]>", "shortest [ms]>",
                   "longest [ms]>", "missing>"}};
  for (const auto& [writer, flow] : found->second)
    table.add({process_of(snapshot, writer), std::to_string(flow.samples),
               number_text(flow.rate_since({}, wall_clock_ns()).samples), number_text(flow.mean * 1e3),
               number_text(flow.deviation() * 1e3), number_text(flow.shortest * 1e3),
               number_text(flow.longest * 1e3), std::to_string(flow.missing)});
  table.print(std::cout);
}

int hz(HzOptions& options) {
  using Clock = std::chrono::steady_clock;
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found("invar hz");
    return 1;
  }
  const std::string topic = cell.topic(options.call.word(0));
  if (cell.wait_for_writers(options.call.word(0)).empty()) {
    std::cerr << "invar hz: nobody writes `" << topic << "` within " << cell.patience().in_seconds()
              << " s; `invar topics` lists what there is\n";
    return 1;
  }
  TopicWatch watch{cell.node(), [&](const std::string& name) { return name == topic; }};
  watch.look();
  const auto asked = Clock::now();
  while (watch.flows().at(topic).empty() &&
         Clock::now() - asked < std::chrono::nanoseconds{cell.patience().ns} &&
         sleep_for(Duration::milliseconds(20))) {
  }
  const auto begin = Clock::now();  // the duration counts from the first sample
  const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  while (sleep_for(
             Duration::seconds(options.duration > 0.0 ? options.duration - elapsed() : options.interval)) &&
         options.duration <= 0.0)
    print_flow(cell, watch, topic, options.json);
  if (options.duration > 0.0 || interrupted()) print_flow(cell, watch, topic, options.json);
  const auto flows = watch.flows();
  const auto found = flows.find(topic);
  return found != flows.end() && !found->second.empty() ? 0 : 1;
}

}  // namespace

void add_hz(CLI::App& program) {
  auto* command = program.add_subcommand("hz", "Measure a topic's rate, its jitter and its losses");
  command->footer(
      "Example: invar hz deployment/xy-table.yaml stage_x.state --duration 5\n"
      "Intervals are between the times at which the writer sent, and the rate is their number over their "
      "sum, "
      "as in `invar top`;\nmissing samples are gaps in its numbers.\n"
      "Ctrl-C ends it. Exit status: 0; 1 nothing came; 2 a fault of the call or the file");
  auto options = std::make_shared<HzOptions>(*command);
  command
      ->add_option("--duration", options->duration,
                   "end after this time [s]; otherwise every `--interval` until Ctrl-C")
      ->check(positive());
  command->add_option("--interval", options->interval, "between two looks [s] (2)")
      ->check(CLI::Range(0.05, 3600.0))
      ->excludes("--duration");
  command->add_flag("--json", options->json, "one JSON object a look");
  command->callback([options] {
    if (const int result = hz(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
