// A count that Eigen or a loop over axes keeps as int, as the index of a container.
#pragma once

#include <cstddef>

namespace invar {

/// `i`, not negative, as std::size_t.
constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace invar
