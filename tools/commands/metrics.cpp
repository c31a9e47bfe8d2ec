// `invar metrics`: a running cell for Prometheus.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>
#include <string>

#include "core/base/name.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/silence.hpp"
#include "tools/metrics/cell_metrics.hpp"
#include "tools/metrics/exporter.hpp"

namespace invar::tools {

namespace {

struct MetricsOptions {
  explicit MetricsOptions(CLI::App& command) : call{command, {}} {}
  CellCall call;
  std::string listen = "127.0.0.1:9464";
  bool no_topics = false;
};

constexpr std::size_t most =
    1000;  // topics, processes, sources of notices: who floods the cell fills no memory here

/// "3f2a...": the release that a cell file of `invar deploy` lies in; empty: it lies elsewhere.
std::string release_of(const std::filesystem::path& file) {
  const auto path = std::filesystem::weakly_canonical(file);
  for (auto part = path.begin(); part != path.end(); ++part)
    if (*part == "releases" && std::next(part) != path.end()) return std::next(part)->string();
  return "";
}

/// Looks at the cell, and keeps what only grows.
class Watch {
 public:
  explicit Watch(LiveCell& cell, bool all_topics)
      : cell_{cell},
        topics_{cell.node(),
                [this, all_topics](const std::string& topic) {
                  return topics_.topics() < most && topic.starts_with("cell/" + cell_.name() + "/") &&
                         !is_service_topic(topic) && (all_topics || devices_topics_.contains(topic));
                },
                [this](const dds::Endpoint& writer, const dds::RawSample& sample) {
                  if (DeviceSigns::tells(writer.type))
                    devices_.take(writer.topic, writer.type, cell_number_, sample);
                }},
        all_topics_{all_topics} {
    look_.status.cell = cell.name();
    look_.status.secured = cell.is_secured();
    if (cell.file() == nullptr) return;
    look_.release = release_of(cell.file()->file);
    for (const auto& process : cell.file()->processes) {
      names_.insert(process.name);
      for (const auto& component : process.components) names_.insert(component.name);
    }
  }

  const CellLook& look() {
    CellStatus& status = look_.status;
    status.processes = cell_.client().processes();
    status.components = cell_.client().components();
    std::erase_if(status.processes, [&](const auto& p) { return is_foreign(p.process_name().c_str()); });
    std::erase_if(status.components, [&](const auto& c) { return is_foreign(c.component_name().c_str()); });
    if (!status.processes.empty()) cell_number_ = status.processes.front().cell();
    status.silent = silence_.of(status.processes);
    if (cell_.file() != nullptr) status.missing = not_heard(*cell_.file(), status.processes);
    count_notices();
    if (!all_topics_) find_devices();
    topics_.look();
    if (all_topics_) look_.flows = topics_.flows();
    look_.devices = devices_.seen();
    return look_;
  }

 private:
  [[nodiscard]] bool is_foreign(const std::string& name) const {
    return !names_.empty() && !names_.contains(name);
  }
  void count_notices() {
    for (const auto& notice : cell_.client().take_notices()) {
      const std::pair key{std::string{notice.source().c_str()}, notice.level()};
      if (!is_foreign(key.first) && (look_.notices.size() < most || look_.notices.contains(key)))
        ++look_.notices[key];
    }
  }
  void find_devices() {
    for (const auto& end : cell_.node().snapshot().endpoints)
      if (end.is_writer && DeviceSigns::tells(end.type)) devices_topics_.insert(end.topic);
  }

  LiveCell& cell_;
  CellLook look_;
  Silence silence_;
  std::set<std::string> names_;  // of the file: processes and components; empty: there is no file
  std::set<std::string> devices_topics_;
  std::atomic<std::uint32_t> cell_number_{0};
  DeviceSigns devices_;
  TopicWatch topics_;  // last: nothing arrives before all else stands
  bool all_topics_;
};

int metrics(MetricsOptions& options) {
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found("invar metrics");
    return 1;
  }
  Watch watch{cell, !options.no_topics};
  Exporter exporter{options.listen, metrics_of(watch.look()).all()};
  std::cerr << "invar metrics: cell " << printable(cell.name()) << " at http://" << options.listen
            << "/metrics; Ctrl-C ends it\n";
  while (sleep_for(Duration::seconds(1.0))) exporter.set(metrics_of(watch.look()).all());
  return 0;
}

}  // namespace

void add_metrics(CLI::App& program) {
  auto* command = program.add_subcommand("metrics", "Give a running cell's metrics to Prometheus");
  command->footer(
      "Example: invar metrics deployment/xy-table.yaml\n"
      "         invar metrics deployment/xy-table.yaml --as wall --listen 10.0.0.11:9464\n"
      "Prometheus reads them at http://127.0.0.1:9464/metrics; deployment/alerts.yaml has rules for them.\n"
      "Each program that reaches the address of --listen may read. The cell is looked at once a second, "
      "however many "
      "ask.\n"
      "Rates and losses of topics are counted by reading them, which costs the cell's network that much.\n"
      "The cell need not run yet, and may be restarted meanwhile.\n"
      "Exit status: 0; 1 without a cell file, no cell answers; 2 a fault of the call or the file");
  auto options = std::make_shared<MetricsOptions>(*command);
  command->add_option("--listen", options->listen, "address and port of this PC")->capture_default_str();
  command->add_flag("--no-topics", options->no_topics,
                    "count no topics; of devices and recorders only the state is read");
  command->callback([options] {
    if (const int result = metrics(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
