// In which order the components of a process are brought up and taken down: who feeds whom, from their ports.
#pragma once

#include <cstddef>
#include <vector>

#include "core/component/component.hpp"

namespace invar {

/// Indices of `components`, upstream (writers) before downstream (readers). The given order decides
/// where nothing else does, and where the graph is a circle, as in every control loop. A component feeds
/// another when an output is connected to an input, or both carry the same topic.
[[nodiscard]] std::vector<std::size_t> upstream_first(const std::vector<const Component*>& components);

/// [i][k]: signals of `i` reach `k`, directly or through others; commands (inboxes) do not count.
[[nodiscard]] std::vector<std::vector<bool>> signals_reach(const std::vector<const Component*>& components);

}  // namespace invar
