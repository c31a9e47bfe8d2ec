// Ctrl-C for commands that go on until they are stopped.
#pragma once

#include "core/base/time.hpp"

namespace invar::tools {

/// From the first call on Ctrl-C and SIGTERM set this instead of ending the program; a second one ends it at once.
[[nodiscard]] bool interrupted();
/// Sleeps; false when it was interrupted.
bool sleep_for(Duration time);

}  // namespace invar::tools
