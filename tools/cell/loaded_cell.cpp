#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

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
