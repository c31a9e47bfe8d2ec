#include "core/config/security.hpp"

#include <set>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::config {

namespace {

/// They become names of folders, and stand in certificates.
void check_name(const Node& node, const std::string& name, std::set<std::string>& taken) {
  if (const auto flaw = flaw_of_identifier(name, "-"))
    node.fault("`" + clipped(name) + "` is no name: it " + flaw->what, flaw->mend);
  else if (!taken.insert(name).second)
    node.fault("`" + name + "` stands here twice", "give each person and program a name of its own");
}

std::vector<std::string> read_people(const Node& node, const char* role, std::vector<std::string> otherwise,
                                     std::set<std::string>& taken) {
  if (!node.has(role)) {
    for (const auto& name : otherwise) taken.insert(name);
    return otherwise;
  }
  std::vector<std::string> people;
  for (const Node& person : node[role].list()) {
    people.push_back(person.as_text());
    if (person.is_scalar()) check_name(person, people.back(), taken);
  }
  return people;
}

std::vector<std::string> read_topics(const Node& node) {
  std::vector<std::string> topics;
  for (const Node& topic : node.list()) {
    topics.push_back(topic.as_text());
    if (topic.is_scalar() && topics.back().find_first_of("*?[]") != std::string::npos)
      topic.fault("`" + clipped(topics.back()) + "` has a character that means many topics",
                  "name each topic, as `component.port` or `/topic`");
  }
  return topics;
}

}  // namespace

CellSecurity read_security(const Node& node, const std::filesystem::path& folder) {
  CellSecurity security;
  security.keys = node.text("keys", "keys");
  if (security.keys.is_relative()) security.keys = folder / security.keys;
  security.keys = std::filesystem::absolute(security.keys).lexically_normal();
  std::set<std::string> taken;
  security.operators = read_people(node, "operators", security.operators, taken);
  security.viewers = read_people(node, "viewers", security.viewers, taken);
  for (const Node& program : node["plant"].map()) {
    check_name(program, program.key(), taken);
    security.plant.push_back({program.key(), read_topics(program["reads"]), read_topics(program["writes"])});
  }
  return security;
}

}  // namespace invar::config
