#include "tools/cell/plugins.hpp"

#include <dlfcn.h>

#include "tools/cell/plugin_stamp.hpp"

namespace invar::tools {

Fault load_plugin(const std::filesystem::path& file, Registry& registry) {
  if (Fault fault = why_not_a_plugin(file); !fault.what.empty()) return fault;
  void* library = dlopen(std::filesystem::absolute(file).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr)
    return {file.string(), std::string{"cannot be loaded: "} + dlerror(),
            "name a shared library that was built against this version of Invar"};
  using Entry = void (*)(Registry&);
  const auto entry = reinterpret_cast<Entry>(dlsym(library, "invar_add_components"));
  if (entry == nullptr)
    return {file.string(), "has no entry function `invar_add_components`",
            "add INVAR_PLUGIN(registry) { ... } to it"};
  entry(registry);
  return {};
}

bool load_plugins(const config::Cell& cell, Registry& registry, const config::Node& root) {
  const auto places = root["plugins"].list();
  bool all = !root["plugins"].exists() || root["plugins"].is_list();
  for (std::size_t i = 0; i < cell.plugins.size(); ++i) {
    std::error_code unseen;
    if (!std::filesystem::is_regular_file(cell.plugins[i], unseen)) {  // read_cell has said so
      all = false;
      continue;
    }
    const Fault fault = load_plugin(cell.plugins[i], registry);
    if (fault.what.empty()) continue;
    places[i].fault(fault.what, fault.mend);
    all = false;
  }
  return all;
}

}  // namespace invar::tools
