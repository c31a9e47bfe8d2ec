#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

std::string mend_name(const std::string& word, const std::vector<std::string>& names) {
  if (names.empty()) return "there is none";
  if (const std::string near = config::nearest(word, names); !near.empty())
    return "did you mean `" + near + "`?";
  std::string text = "there are: ";
  for (const auto& name : names) text += (name == names.front() ? "" : ", ") + name;
  return text;
}

std::vector<std::string> LoadedCell::process_names() const {
  std::vector<std::string> names;
  for (const LoadedProcess& each : processes) names.push_back(each.file->name);
  return names;
}

LoadedProcess* LoadedCell::process(const std::string& name) {
  for (LoadedProcess& candidate : processes)
    if (candidate.file->name == name) return &candidate;
  return nullptr;
}

Port* LoadedCell::port(const std::string& component, const std::string& name) const {
  for (const LoadedProcess& candidate : processes)
    for (const LoadedComponent& member : candidate.components) {
      if (member.file->name != component || !member.component) continue;
      return member.component->find_port(name);
    }
  return nullptr;
}

}  // namespace invar::tools
