// HostKeys: the keys of a secured cell that belong on one of its PCs.
#pragma once

#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// Whose keys a host has: of its processes, its `invar run`, the bridge where it runs there, and the first viewer, in whose name
/// `invar status` looks at the cell from there. Second participants go along.
[[nodiscard]] std::vector<std::string> key_holders(const LoadedCell& loaded, const std::string& host);

/// An archive (archive_of) of `public` and of the folders of these holders. Empty: none of them has a key on this PC, and the keys
/// are brought by other means. Throws InputError where some have one and others do not.
[[nodiscard]] std::string keys_for(const LoadedCell& loaded, const std::string& host);

}  // namespace invar::tools
