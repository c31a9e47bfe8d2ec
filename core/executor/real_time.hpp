// Rights that the operating system grants a loop: scheduling, core, locked memory, timer slack, touched stack.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/executor/options.hpp"

namespace invar {

/// One thing asked for, and what became of it.
struct Grant {
  std::string what;     // "SCHED_FIFO priority 80"
  std::string setting;  // the key in the cell file, "realtime.priority"
  bool granted = false;
  std::string why;   // when not granted: the system's reason
  std::string mend;  // and what helps
};

/// Asks for everything on the calling thread, which is to be the loop's; of the memory see locked_memory.hpp. Never fails: it
/// says what was granted. Set-up only.
[[nodiscard]] std::vector<Grant> claim_real_time(const RealTimeRequest& request);

/// Touches the next `bytes` of the calling thread's stack, so that no page fault comes later. Keep it well
/// under the thread's stack size.
void touch_stack(std::size_t bytes = 256 * 1024) noexcept;

/// One line a grant that was refused: "realtime.priority: SCHED_FIFO priority 80 not granted (...); mend".
[[nodiscard]] std::vector<std::string> refusals(const std::vector<Grant>& grants);

}  // namespace invar
