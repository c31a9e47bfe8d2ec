// The one shape of a topic for programs (docs/reference-json.md): `topics`, `hz` and `top` show it.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/dds/discovery.hpp"
#include "tools/live/topic_watch.hpp"

namespace invar::tools {

/// "reliable, transient local, deadline 100 ms"
[[nodiscard]] std::string qos_text(const dds::Profile& qos);

/// A topic as discovery knows it.
[[nodiscard]] nlohmann::ordered_json json_of(const std::string& topic,
                                             const std::vector<dds::Endpoint>& writers,
                                             const std::vector<dds::Endpoint>& readers);
/// The same with what was counted of its writers; rates since `before`.
[[nodiscard]] nlohmann::ordered_json json_of(const std::string& topic, const dds::Snapshot& snapshot,
                                             const Flows& now, const Flows& before, std::int64_t now_ns);
/// The process in which an end is, "motion"; of a foreign one its participant's name, else its GUID.
[[nodiscard]] std::string process_of(const dds::Snapshot& snapshot, const std::string& guid);

}  // namespace invar::tools
