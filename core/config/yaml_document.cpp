#include "core/config/yaml_document.hpp"

#include "core/base/shown.hpp"
#include "core/config/yaml.hpp"

namespace invar::config::detail {

std::string located(const Document& document, const Place& place) {
  std::string where = document.file.string();
  if (place.line > 0) where += ":" + std::to_string(place.line);
  if (!place.path.empty()) where += ": " + place.path;
  return where;
}

std::string joined(const std::string& path, const std::string& key) {
  return path.empty() ? clipped(key) : path + "." + clipped(key);
}

namespace {

/// Keys right here that stand twice (of which the parser would keep the first) and keys that nobody asked for.
void collect_keys_at(const Document& document, const Place& place, FaultList& faults) {
  if (!place.yaml.IsDefined() || !place.yaml.IsMap()) return;
  const auto located_at = [&](const YAML::Node& key) {
    return document.file.string() + ":" + std::to_string(key.Mark().line + 1) + ": " +
           joined(place.path, key.IsNull()     ? "~"
                              : key.IsScalar() ? key.Scalar()
                                               : "?");
  };
  std::set<std::string> seen;
  for (const auto& entry : place.yaml)
    if (!entry.first.IsScalar())
      faults.add({located_at(entry.first), "is no key", "write a word before the colon"});
    else if (!seen.insert(entry.first.Scalar()).second)
      faults.add({located_at(entry.first), "stands twice", "keep one of them"});
  if (place.accept_all || place.known.empty()) return;
  const std::vector<std::string> known{place.known.begin(), place.known.end()};
  for (const auto& entry : place.yaml) {
    const std::string key = entry.first.Scalar();
    if (!entry.first.IsScalar() || place.known.contains(key)) continue;
    std::string mend = "remove it, or use one of: ";
    if (const std::string near = nearest(key, known); !near.empty()) {
      mend = "did you mean `" + near + "`?";
      if (const auto meant = place.child(near)) faults.withdraw(located(document, *meant), missing);
    } else {
      for (const auto& name : known) mend += (name == known.front() ? "" : ", ") + name;
    }
    faults.add({located_at(entry.first), "unknown key", mend});
  }
}

}  // namespace

void collect_keys(const Document& document, const Place& place, FaultList& faults) {
  collect_keys_at(document, place, faults);
  if (place.accept_all) return;
  for (const auto& [key, child] : place.children) collect_keys(document, *child, faults);
}

}  // namespace invar::config::detail
