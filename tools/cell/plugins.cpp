#include "tools/cell/plugins.hpp"

#include <dlfcn.h>

namespace invar::tools {

bool load_plugins(const config::Cell& cell, Registry& registry, const config::Node& root) {
  const auto places = root["plugins"].list();
  bool all = !root["plugins"].exists() || root["plugins"].is_list();
  for (std::size_t i = 0; i < cell.plugins.size(); ++i) {
    std::error_code unseen;
    if (!std::filesystem::is_regular_file(cell.plugins[i], unseen)) {  // read_cell has said so
      all = false;
      continue;
    }
    void* library = dlopen(std::filesystem::absolute(cell.plugins[i]).c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      places[i].fault(std::string{"cannot be loaded: "} + dlerror(),
                      "name a shared library that was built against this version of Invar");
      all = false;
      continue;
    }
    using Entry = void (*)(Registry&);
    const auto entry = reinterpret_cast<Entry>(dlsym(library, "invar_add_components"));
    if (entry == nullptr) {
      places[i].fault("has no entry function `invar_add_components`",
                      "add INVAR_PLUGIN(registry) { ... } to it");
      all = false;
      continue;
    }
    entry(registry);
  }
  return all;
}

}  // namespace invar::tools
