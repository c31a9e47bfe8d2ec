// Component types from shared libraries outside this tree.
#pragma once

#include <filesystem>

#include "core/base/fault.hpp"
#include "core/component/registry.hpp"
#include "core/config/cell.hpp"

namespace invar::tools {

/// Adds the components of one library. Without `what`: done.
[[nodiscard]] Fault load_plugin(const std::filesystem::path& file, Registry& registry);

/// Each library has one entry function, `extern "C" void invar_add_components(invar::Registry&)`; INVAR_PLUGIN in
/// core/component/plugin.hpp writes it. Faults (not loadable, no entry) go to the cell file's document. A library stays
/// loaded until the process ends. True: all were loaded, so what no one brought is no component type.
bool load_plugins(const config::Cell& cell, Registry& registry, const config::Node& root);

}  // namespace invar::tools
