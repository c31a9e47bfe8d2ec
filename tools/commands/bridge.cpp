// `invar bridge`: passes the topics that the cell file names between the cell and the plant.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/cell/bridge.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/process_claim.hpp"
#include "tools/cell/service_manager.hpp"
#include "tools/host/own_host.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct BridgeOptions {
  std::filesystem::path cell;
  std::string host;
  double duration = 0.0;
  bool json = false;
};

dds::NodeOptions plant_options(const config::Cell& cell, const BridgeFile& file) {
  dds::NodeOptions options;
  options.cell = cell.name;
  options.process = "bridge-to-plant";
  options.domain = file.domain;
  options.addresses = file.addresses;
  options.may_come_later = true;
  for (const std::string& peer : file.peers) options.peers.push_back({peer, 10});
  options.shared_memory = false;
  options.raw_by_general = true;
  options.identity = file.plant;
  return options;
}

void print_bridge(const BridgeFile& file, const Bridge& bridge, bool json) {
  auto all = nlohmann::ordered_json::array();
  TextTable table{{"topic of the plant", "way", "came>", "passed>", "left out>", "refused>"}};
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const BridgeCount count = bridge.count(i);
    const bool is_out = file.lines[i].direction == Direction::out;
    table.add({file.lines[i].plant_topic, is_out ? "out" : "in", std::to_string(count.came),
               std::to_string(count.passed), std::to_string(count.left_out), std::to_string(count.refused)});
    all.push_back({{"plant_topic", file.lines[i].plant_topic},
                   {"cell_topic", file.lines[i].cell_topic},
                   {"way", is_out ? "out" : "in"},
                   {"came", count.came},
                   {"passed", count.passed},
                   {"left_out", count.left_out},
                   {"refused", count.refused}});
  }
  if (json)
    std::cout << all.dump(2) << '\n';
  else
    table.print(std::cout);
}

void tell_alarms(dds::Node& node) {
  for (const auto& alarm : node.take_alarms())
    std::cerr << "bridge: " << alarm.topic << ": " << alarm.text << '\n';
}

int run(const BridgeOptions& options) {
  ServiceManager manager = ServiceManager::from_environment();  // before any thread
  const LoadedCell loaded = load_cell(options.cell);
  const BridgeFile file = read_bridge(loaded);
  if (file.lines.empty())
    throw InputError{options.cell.string(), "has no `bridge`",
                     "add one: see `Keys of the bridge` in docs/reference/cell-file.md"};
  if (!own_hosts(*loaded.cell, options.host).contains(file.host))
    throw InputError{options.cell.string() + ": bridge.host",
                     "`" + file.host + "` is another PC than this one", "start the bridge there"};
  const ProcessClaim claim{*loaded.cell, config::bridge_name};
  (void)interrupted();
  dds::NodeOptions of_cell = node_on(*loaded.cell, config::bridge_name, file.host);
  of_cell.clocks = clocks_on(*loaded.cell, file.host);
  of_cell.raw_by_general = true;  // one certificate
  dds::Node cell{of_cell, dds::load_profiles(loaded.cell->profiles)};
  dds::Node plant{plant_options(*loaded.cell, file), dds::load_profiles(loaded.cell->profiles)};
  Bridge bridge{file, loaded.cell->id, cell, plant};
  std::cerr << "bridge: cell `" << loaded.cell->name << "`, domain " << loaded.cell->domain
            << ", and the plant, domain " << file.domain << ": " << file.lines.size()
            << " topics; Ctrl-C ends it\n";
  manager.ready();
  constexpr Duration period = Duration::milliseconds(2);
  const auto steps = static_cast<std::int64_t>(options.duration / period.in_seconds());
  for (std::int64_t step = 0; (steps == 0 || step < steps) && sleep_for(period); ++step) {
    bridge.pass();
    manager.feed(static_cast<std::uint64_t>(step));
    if (step % 500 != 0) continue;
    tell_alarms(cell);
    tell_alarms(plant);
  }
  manager.stopping();
  print_bridge(file, bridge, options.json);
  return 0;
}

}  // namespace

void add_bridge(CLI::App& program) {
  auto* command =
      program.add_subcommand("bridge", "Pass named topics between a cell and the plant's DDS domain");
  command->footer(
      "Example: invar bridge cell.yaml\n"
      "The part `bridge` of the cell file names the plant's domain and the topics, each one way and at a "
      "bounded rate.\n"
      "In a secured cell the bridge has a certificate of its own; `security` of the part is for a secured "
      "plant.\n"
      "`invar units` and `invar deploy` write its service.\n"
      "Only these pass. Ends with a table of what passed, was left out by the rate, and was refused.\n"
      "Exit status: 0; 1 the network failed; 2 a fault of the call or the file");
  auto options = std::make_shared<BridgeOptions>();
  command->add_option("cell", options->cell, "the cell file")->required();
  command->add_option("--host", options->host, "the host that this PC is, where its address may come later");
  command->add_option("--duration", options->duration, "end after so many seconds (0: at Ctrl-C)")
      ->check(CLI::Range(0.0, 1e9));
  command->add_flag("--json", options->json, "print the counts as JSON");
  command->callback([options] {
    if (const int status = run(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools
