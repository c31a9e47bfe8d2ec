// How a process runs its components: rate, overrun policy, real-time requirements; as its cell file declares.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/time.hpp"
#include "core/config/yaml.hpp"

namespace invar {

/// What happens when a cycle is not finished when the next one is due. In every case the cycle number keeps
/// to the clock: whole periods that went by are left out and counted.
enum class OverrunPolicy : std::uint8_t {
  skip,      // carry on at the next period
  degrade,   // halve the rate (down to an eighth) until there is room again; steps are told their longer
             // period
  safe_stop  // deactivate all components, downstream first, outputs to their safe values
};
[[nodiscard]] std::string_view to_text(OverrunPolicy policy);

/// What a process asks of the operating system. Absent: nothing (a worker process).
struct RealTimeRequest {
  int priority = 0;          // of SCHED_FIFO, 1..98; 0: the usual scheduling
  std::optional<int> cpu;    // the one core the loop's thread may use
  bool lock_memory = false;  // mlockall, present and future pages; the stack is touched beforehand
  bool require =
      false;  // true: refuse to run when something is not granted; false: run and say so in every status
};

struct ExecutorOptions {
  std::string process = "process";  // its name in messages
  Duration period = Duration::milliseconds(1);
  OverrunPolicy overrun = OverrunPolicy::skip;
  /// Lost periods within one second that `degrade` and `safe_stop` put up with before they act.
  std::uint32_t tolerated = 0;
  std::optional<RealTimeRequest> real_time;
  bool simulated = false;          // driven by advance_to instead of a clock
  std::uint32_t black_box = 1024;  // cycles kept
};

/// Reads `rate`, `overrun`, `tolerate` and `realtime: {rate, priority, cpu, lock_memory, require, overrun,
/// tolerate}` of one process of a cell file. Rates in Hz. Without any rate: 100 Hz.
///
///     motion: {realtime: {rate: 1000, priority: 80, cpu: 1, lock_memory: true, overrun: skip, require:
///     false}, ...} heat:   {rate: 10, ...}
[[nodiscard]] ExecutorOptions read_executor_options(const config::Node& process);

}  // namespace invar
