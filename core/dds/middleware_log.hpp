// MiddlewareLog: what Fast DDS would print on the terminal, kept and said once in the cell's own way.
#pragma once

#include <string>
#include <vector>

namespace invar::dds {

/// From the first call on, Fast DDS prints nothing. Set-up only.
void keep_middleware_log();
/// Its errors since the last call, each kind once in the life of the process, oldest first. Any thread.
[[nodiscard]] std::vector<std::string> take_middleware_errors();
/// The newest error, for the message of a call that failed; empty: none. Waits until the library has said it.
[[nodiscard]] std::string newest_middleware_error();

}  // namespace invar::dds
