#include "tools/live/topic_json.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

nlohmann::ordered_json json_of(const dds::Endpoint& end) {
  return {{"guid", end.id}, {"participant", end.participant}, {"type", end.type}, {"qos", qos_text(end.qos)}};
}

nlohmann::ordered_json json_of(const std::vector<dds::Endpoint>& ends) {
  auto list = nlohmann::ordered_json::array();
  for (const auto& end : ends) list.push_back(json_of(end));
  return list;
}

nlohmann::ordered_json json_of(const std::string& topic) {
  return {{"topic", topic},
          {"type", ""},
          {"rate_hz", nullptr},
          {"bytes_per_s", nullptr},
          {"missing", nullptr},
          {"writers", nlohmann::ordered_json::array()},
          {"readers", nlohmann::ordered_json::array()}};
}

const dds::Endpoint* find(const dds::Snapshot& snapshot, const std::string& guid) {
  const auto found = std::find_if(snapshot.endpoints.begin(), snapshot.endpoints.end(),
                                  [&](const dds::Endpoint& end) { return end.id == guid; });
  return found == snapshot.endpoints.end() ? nullptr : &*found;
}

}  // namespace

std::string qos_text(const dds::Profile& qos) {
  std::string text = qos.reliable ? "reliable" : "best effort";
  if (qos.durability == dds::Durability::transient_local) text += ", transient local";
  if (qos.durability > dds::Durability::transient_local) text += ", persistent";
  if (qos.exclusive) text += ", exclusive (" + std::to_string(qos.strength) + ")";
  const auto time = [&](const char* what, Duration value) {
    if (value.ns != 0)
      text += std::string{", "} + what + " " + number_text(static_cast<double>(value.ns) * 1e-6) + " ms";
  };
  time("deadline", qos.deadline);
  time("lifespan", qos.lifespan);
  time("lease", qos.lease);
  return text;
}

nlohmann::ordered_json json_of(const std::string& topic, const std::vector<dds::Endpoint>& writers,
                               const std::vector<dds::Endpoint>& readers) {
  auto json = json_of(topic);
  json["type"] = !writers.empty() ? writers.front().type : readers.empty() ? "" : readers.front().type;
  json["writers"] = json_of(writers);
  json["readers"] = json_of(readers);
  return json;
}

nlohmann::ordered_json json_of(const std::string& topic, const dds::Snapshot& snapshot, const Flows& now,
                               const Flows& before, std::int64_t now_ns) {
  std::vector<dds::Endpoint> readers;
  for (const auto& end : snapshot.endpoints)
    if (end.topic == topic && !end.is_writer && !end.is_local) readers.push_back(end);
  auto json = json_of(topic, {}, readers);
  std::uint64_t missing = 0;
  for (const auto& [guid, flow] : now) {
    const dds::Endpoint* end = find(snapshot, guid);
    auto writer = end != nullptr ? json_of(*end)
                                 : nlohmann::ordered_json{
                                       {"guid", guid}, {"participant", ""}, {"type", ""}, {"qos", ""}};
    if (end != nullptr) json["type"] = end->type;
    const auto earlier = before.find(guid);
    writer["samples"] = flow.samples;
    writer["rate_hz"] = flow.rate_since(earlier == before.end() ? Flow{} : earlier->second, now_ns).samples;
    writer["missing"] = flow.missing;
    writer["interval_mean_s"] = flow.mean;
    writer["interval_deviation_s"] = flow.deviation();
    writer["interval_shortest_s"] = flow.shortest;
    writer["interval_longest_s"] = flow.longest;
    json["writers"].push_back(std::move(writer));
    missing += flow.missing;
  }
  const Flow::Rate rate = rate_of(now, before, now_ns);
  json["rate_hz"] = rate.samples;
  json["bytes_per_s"] = rate.bytes;
  json["missing"] = missing;
  return json;
}

std::string process_of(const dds::Snapshot& snapshot, const std::string& guid) {
  const dds::Endpoint* end = find(snapshot, guid);
  if (end == nullptr || end->participant.empty()) return guid;
  // "invar/<cell>/<process>" and "invar/<cell>/<process>/realtime"
  std::string name = end->participant;
  if (!name.starts_with("invar/")) return name;
  name = name.substr(std::min(name.size(), name.find('/', 6) + 1));
  return name.substr(0, name.find('/'));
}

}  // namespace invar::tools
