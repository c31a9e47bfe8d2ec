#include "core/dds/profile.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <limits>
#include <sstream>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::dds {

namespace {

Duration time_of(const config::Node& node, std::string_view key) {
  if (!node.has(key)) return {};
  return Duration::seconds(node.number(key, "s", Range{1e-6, 1e6}));
}

Durability durability_of(const config::Node& node) {
  return node.choice("durability", {"volatile", "transient_local"}) == "transient_local"
             ? Durability::transient_local
             : Durability::volatile_;
}

Profile read_profile(const config::Node& node) {
  Profile p;
  p.name = node.key();
  if (const auto flaw = flaw_of_identifier(p.name, "-"))
    node.fault("`" + clipped(p.name) + "` is no name: it " + flaw->what, flaw->mend);
  p.purpose = node.text("for");
  p.traffic = node.choice("traffic", {"realtime", "general"}, "general") == "realtime" ? Traffic::realtime
                                                                                       : Traffic::general;
  p.reliable = node.choice("reliability", {"best_effort", "reliable"}) == "reliable";
  p.keep_all = node.has("keep_all");
  if (p.keep_all && node.has("keep_last"))
    node["keep_last"].fault("stands beside keep_all", "keep one of the two");
  p.depth = node.integer(p.keep_all ? "keep_all" : "keep_last", 1, 1'000'000);
  p.durability = durability_of(node);
  p.deadline = time_of(node, "deadline");
  p.lifespan = time_of(node, "lifespan");
  p.lease = time_of(node, "lease");
  const auto liveliness =
      node.choice("liveliness", {"automatic", "manual_by_participant", "manual_by_topic"}, "automatic");
  p.liveliness = liveliness == "automatic"         ? Liveliness::automatic
                 : liveliness == "manual_by_topic" ? Liveliness::manual_by_topic
                                                   : Liveliness::manual_by_participant;
  p.exclusive = node.choice("ownership", {"shared", "exclusive"}, "shared") == "exclusive";
  p.strength = node.integer("strength", 0, std::numeric_limits<std::int32_t>::max(), 0);
  p.max_instances = node.integer("max_instances", 1, 1'000'000, 64);
  p.flow = node.integer("flow_bytes_per_second", 1000, 100'000'000'000, 0);
  if (node.has("partitions")) p.partitions = node["partitions"].as_texts();

  if (p.durability == Durability::transient_local && !p.reliable)
    node["durability"].fault("transient_local needs reliability: reliable", "make it volatile or reliable");
  if (!p.exclusive && node.has("strength"))
    node["strength"].fault("counts only with ownership: exclusive",
                           "remove it or make the ownership exclusive");
  if (p.liveliness != Liveliness::automatic && p.lease.ns == 0)
    node["liveliness"].fault("has no lease",
                             "add `lease`, the time after which a silent writer counts as dead");
  if (p.flow > 0 && !p.reliable)
    node["flow_bytes_per_second"].fault(
        "a best-effort writer with a flow bound keeps a thread of Fast DDS spinning",
        "make it reliable or remove it");
  if (p.lifespan.ns != 0 && p.deadline.ns != 0 && p.lifespan < p.deadline)
    node["lifespan"].fault("is shorter than the deadline: samples would vanish before the next may come",
                           "make it at least the deadline");
  return p;
}

Profiles read(const config::Yaml& yaml) {
  const config::Node root = yaml.root();
  (void)root.integer("invar_profiles", 1, 1);
  Profiles profiles;
  const config::Node list = root.required("profiles");
  if (list.exists())
    for (const auto& node : list.children()) profiles[node.key()] = read_profile(node);
  yaml.finish();
  return profiles;
}

const char* name_of(Durability kind) {
  constexpr std::array names{"volatile", "transient_local", "transient", "persistent"};
  return names.at(static_cast<std::size_t>(kind));
}
const char* name_of(Liveliness kind) {
  constexpr std::array names{"automatic", "manual_by_participant", "manual_by_topic"};
  return names.at(static_cast<std::size_t>(kind));
}

std::string shown(Duration time) {
  if (time.ns == 0) return "none";
  std::ostringstream text;
  text << static_cast<double>(time.ns) / 1e6 << " ms";
  return text.str();
}

std::string shown(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + (name.empty() ? "\"\"" : name);
  return names.empty() ? "\"\"" : text;
}

std::string shown(const std::vector<std::int16_t>& kinds) {
  std::string text;
  for (const auto kind : kinds)
    text += (text.empty() ? "" : ", ") + (kind == 0   ? std::string{"XCDR1"}
                                          : kind == 2 ? "XCDR2"
                                                      : std::to_string(kind));
  return kinds.empty() ? "XCDR1" : text;
}

/// Zero means infinite: the most that can be asked of a deadline by a writer, the least by a reader.
bool longer(Duration offered, Duration requested) {
  if (requested.ns == 0) return false;
  return offered.ns == 0 || offered > requested;
}

bool is_pattern(const std::string& name) { return name.find_first_of("*?[") != std::string::npos; }

/// A pattern on one side may match a name on the other; two patterns never match each other.
bool share_partition(std::vector<std::string> a, std::vector<std::string> b) {
  if (a.empty()) a.emplace_back();
  if (b.empty()) b.emplace_back();
  return std::any_of(a.begin(), a.end(), [&b](const std::string& x) {
    return std::any_of(b.begin(), b.end(), [&x](const std::string& y) {
      if (x == y) return true;
      if (is_pattern(x) == is_pattern(y)) return false;
      return is_pattern(x) ? fnmatch(x.c_str(), y.c_str(), 0) == 0 : fnmatch(y.c_str(), x.c_str(), 0) == 0;
    });
  });
}

}  // namespace

Profiles load_profiles(const std::filesystem::path& file) { return read(config::Yaml::load(file)); }

Profiles parse_profiles(const std::string& text, const std::string& name) {
  return read(config::Yaml::parse(text, name));
}

std::string Mismatch::text() const {
  return policy + ": writer offers " + offered + ", reader asks for " + requested;
}

std::vector<Mismatch> mismatches(const Profile& writer, const Profile& reader) {
  std::vector<Mismatch> found;
  if (reader.reliable && !writer.reliable) found.push_back({"reliability", "best_effort", "reliable"});
  if (writer.durability < reader.durability)
    found.push_back({"durability", name_of(writer.durability), name_of(reader.durability)});
  if (longer(writer.deadline, reader.deadline))
    found.push_back({"deadline", shown(writer.deadline), shown(reader.deadline)});
  if (writer.liveliness < reader.liveliness)
    found.push_back({"liveliness", name_of(writer.liveliness), name_of(reader.liveliness)});
  else if (longer(writer.lease, reader.lease))
    found.push_back({"liveliness lease", shown(writer.lease), shown(reader.lease)});
  if (writer.exclusive != reader.exclusive)
    found.push_back(
        {"ownership", writer.exclusive ? "exclusive" : "shared", reader.exclusive ? "exclusive" : "shared"});
  if (!share_partition(writer.partitions, reader.partitions))
    found.push_back({"partition", shown(writer.partitions), shown(reader.partitions)});
  // A writer uses the first of its list; a reader takes any of its list.
  const std::int16_t sent = writer.representations.empty() ? std::int16_t{0} : writer.representations.front();
  const auto& taken = reader.representations;
  if (taken.empty() ? sent != 0 : std::find(taken.begin(), taken.end(), sent) == taken.end())
    found.push_back({"data representation", shown(writer.representations), shown(taken)});
  return found;
}

}  // namespace invar::dds
