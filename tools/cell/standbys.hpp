// Standbys: joins each component that stands by with the one that it stands by for.
#pragma once

#include <set>
#include <string>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// Both are told of each other, and the ports by which they hear one another get their topics. Before the other ports are joined.
/// Faults go to the document.
void pair_standbys(LoadedCell& loaded);

/// Topics that one of two components writes, whichever leads. Before the components run.
[[nodiscard]] std::set<std::string> shared_topics(const LoadedCell& loaded);

/// Whether a component of this process stands by for one on another PC, or the other way round. Before the components run.
[[nodiscard]] bool has_partner_on_another_pc(const LoadedCell& loaded, const std::string& process);

/// A standby that cannot do what the other does, as its inputs would be lost with the other. After the ports were joined.
void check_standbys(const LoadedCell& loaded);

}  // namespace invar::tools
