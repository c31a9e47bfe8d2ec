#include "tools/cell/bridge_file.hpp"

#include <algorithm>
#include <set>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"
#include "core/dds/wire_type.hpp"
#include "idl/stage.h"
#include "tools/cell/connections.hpp"

namespace invar::tools {

namespace {

using config::Node;

/// An output of the cell for `out`, an input for `in`; nullptr with a fault: there is none.
const Port* find_port(const LoadedCell& loaded, const Node& node, Direction direction) {
  const std::string text = node.as_text();
  const Port* port = named_port(loaded, text, node);
  if (port == nullptr) return nullptr;
  const bool is_output = port->direction() == Port::Direction::output;
  if (is_output == (direction == Direction::out)) return port;
  const config::CellComponent* component = loaded.cell->find(text.substr(0, text.find('.')));
  node.fault(
      "`" + clipped(text) + "` is no " + (direction == Direction::out ? "output" : "input") + " of the cell",
      "`invar types " + component->type + "` lists its ports");
  return nullptr;
}

void read_line(const LoadedCell& loaded, const Node& node, Direction direction, BridgeFile& bridge) {
  BridgeLine line;
  line.direction = direction;
  const Node topic = node.required("topic");
  line.plant_topic = topic.as_text();
  line.rate = node.number("rate", "Hz", Range{0.01, 1000.0}, 10.0);
  const bool is_safe = !line.plant_topic.empty() && line.plant_topic.size() <= longest_topic &&
                       !line.plant_topic.starts_with("cell/") &&
                       std::all_of(line.plant_topic.begin(), line.plant_topic.end(), [](unsigned char c) {
                         return std::isalnum(c) != 0 || c == '_' || c == '/';
                       });
  if (topic.exists() && !is_safe)
    topic.fault("`" + clipped(line.plant_topic) + "` is no topic of the plant",
                "use letters, digits, `_` and `/`, and begin with another word than `cell`");
  const Node at = node.required("port");
  const Port* port = at.exists() ? find_port(loaded, at, direction) : nullptr;
  if (port == nullptr) return;
  if (direction == Direction::in && port->type() == typeid(stage::AxisCommand))
    at.fault("moves an axis, and the cell could not tell that the plant's program died",
             "let the plant order a job, or join the cell itself");
  line.profile = port->profile;
  line.cell_topic = port->topic.empty() ? loaded.cell->topic(at.as_text()) : port->topic;
  const dds::WireType* type = dds::WireTypes::all().find(port->type());
  if (type == nullptr)
    at.fault("its type is none of IDL", "name a port whose type travels");
  else
    line.type = type->name();
  bridge.lines.push_back(std::move(line));
}

/// A topic that went both ways would come back for ever.
void check_one_way(const Node& node, const BridgeFile& bridge) {
  std::set<std::string> plant, cell;
  for (const BridgeLine& line : bridge.lines) {
    if (!plant.insert(line.plant_topic).second)
      node.fault("names the topic `" + clipped(line.plant_topic) + "` of the plant twice",
                 "give each line a topic of its own: one that goes both ways comes back for ever");
    if (!cell.insert(line.cell_topic).second)
      node.fault("names the topic `" + clipped(line.cell_topic) + "` of the cell twice",
                 "keep one of the lines");
  }
}

std::vector<std::string> addresses(const Node& node) {
  std::vector<std::string> all = node.as_texts();
  for (const std::string& address : all)
    if (const std::string flaw = config::flaw_of_address(address); !flaw.empty())
      node.fault("`" + clipped(address) + "` " + flaw, "write it as 10.0.0.11");
  return all;
}

}  // namespace

BridgeFile read_bridge(const LoadedCell& loaded) {
  BridgeFile bridge;
  const Node node = loaded.yaml.root()["bridge"];
  if (!node.exists()) return bridge;
  bridge.domain = static_cast<std::uint32_t>(node.integer("domain", 0, 232));
  if (node.has("domain") && static_cast<int>(bridge.domain) == loaded.cell->domain)
    node["domain"].fault("is the domain of the cell itself", "name the plant's, which is another");
  bridge.host = node.text("host", loaded.cell->hosts.empty() ? "" : loaded.cell->hosts.front().name);
  const auto& hosts = loaded.cell->hosts;
  if (std::none_of(hosts.begin(), hosts.end(), [&](const auto& host) { return host.name == bridge.host; }))
    node["host"].fault("`" + clipped(bridge.host) + "` is no host of this cell", "name one of `hosts`");
  bridge.addresses = addresses(node["addresses"]);
  bridge.peers = addresses(node["peers"]);
  if (const Node security = node["security"]; security.exists()) {
    std::filesystem::path keys = security.text("keys");
    if (keys.is_relative()) keys = loaded.cell->file.parent_path() / keys;
    bridge.plant = dds::Identity{{keys}, security.text("name"), false};
  }
  for (const Node& line : node["out"].list()) read_line(loaded, line, Direction::out, bridge);
  for (const Node& line : node["in"].list()) read_line(loaded, line, Direction::in, bridge);
  if (!node.has("out") && !node.has("in"))
    node.fault("names no topic", "add `out: [{port: stage_x.state, topic: plant/line1/stage_x}]`");
  check_one_way(node, bridge);
  for (const auto& process : loaded.cell->processes)
    if (process.name == config::bridge_name)
      node.fault("would have the name of the process `" + process.name + "`",
                 "give the process another name");
  return bridge;
}

}  // namespace invar::tools
