// How a process runs its components: rate, overrun policy, real-time requirements; as its cell file declares.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/time.hpp"
#include "core/config/cell.hpp"

namespace invar {

/// The answer to a cycle that is not finished when the next one is due. In every case the cycle number keeps to
/// the clock: whole periods that went by are left out and counted.
///   skip       carry on at the next period
///   degrade    halve the rate (down to an eighth) until there is room again; steps are told their longer period
///   safe_stop  deactivate all components, downstream first, outputs to their safe values
using config::OverrunPolicy;
/// The answer to a cycle that ends later than `latency`, or to a sample of an input that is older than it may be.
/// Always counted and shown by the status; `event` also gives a notice, `safe_stop` stops as an overrun may.
using config::LatePolicy;
/// The rights that a process asks the operating system for.
using RealTimeRequest = config::RealtimeRequest;

[[nodiscard]] std::string_view to_text(OverrunPolicy policy);

struct ExecutorOptions {
  std::string process = "process";  // its name in messages
  Duration period = Duration::milliseconds(1);
  OverrunPolicy overrun = OverrunPolicy::skip;
  std::uint32_t tolerated = 0;  // lost periods within a second that degrade and safe_stop put up with
  std::optional<RealTimeRequest> real_time;  // absent: nothing (a worker process)
  /// How long a component that is to be deactivated may take to come to rest: 1 m/s at 0.5 m/s2 is 2 s, and who stops a
  /// process waits 10 s before killing it.
  Duration wind_down = Duration::seconds(3.0);
  LatePolicy late = LatePolicy::event;
  bool simulated = false;          // driven by advance_to instead of a clock
  std::uint32_t black_box = 1024;  // cycles kept
};

/// As the cell file declares the process.
[[nodiscard]] ExecutorOptions executor_options(const config::CellProcess& process, bool simulated);

}  // namespace invar
