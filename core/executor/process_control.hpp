// ProcessControl: what a supervisor, a status display or a command line may ask of one process; no
// middleware.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/component/lifecycle.hpp"
#include "core/executor/executor.hpp"

namespace invar {

struct ComponentStatus {
  std::string name;
  std::string type;
  LifecycleState state = LifecycleState::unconfigured;
  std::string failure;  // when in error
  std::uint32_t every = 1;
  std::uint64_t steps = 0;
  std::uint64_t lost =
      0;  // samples that its inputs refused: their sender does not own them, or the inbox was full
  Percentiles compute;  // of its step; empty in simulated time
  std::vector<InputAge> ages;
};

struct ProcessStatus {
  std::string process;
  bool simulated = false;
  bool running = false;
  Duration period;
  OverrunPolicy overrun = OverrunPolicy::skip;
  LoopCounters counters;
  Percentiles wake_up;                    // lateness of waking
  Percentiles compute;                    // from waking to the end of the work
  std::optional<Duration> latency_limit;  // as declared
  Percentiles latency;                    // from when a cycle is due to the end of its work
  std::string trip_reason;                // empty: not tripped
  std::vector<std::string> not_granted;   // real-time requests that the system refused, one line each
  std::vector<ComponentStatus> components;
};

struct ParameterStatus {
  ParameterInfo info;
  std::optional<double> value;  // of changeable numbers, as the loop applied it last
};

/// Any thread but the loop's; several at once take turns where something is changed. Nothing here disturbs
/// the loop.
class ProcessControl {
 public:
  explicit ProcessControl(Executor& executor) : executor_{executor} {}

  [[nodiscard]] ProcessStatus status() const;
  [[nodiscard]] ComponentStatus component(std::size_t index) const;

  /// Carries out a transition of one component, or of all when `component` is empty or "all", and waits for it.
  /// Configure and activate of all go upstream first and stop at the first failure. Deactivate, cleanup
  /// and shutdown go downstream first and carry on. Components that the request does not concern count as being
  /// there (configure: those already active; reset: those not in error). Reset of all also clears a trip.
  ///
  /// The same id gives the same outcome without doing anything again; id 0: never repeated.
  Outcome request(std::string_view component, Transition transition, std::uint64_t id = 0);

  [[nodiscard]] std::vector<ParameterStatus> parameters(std::string_view component) const;
  /// Changes a number declared `while_running`; `unit` is converted when given. Empty: applied; otherwise why
  /// not and how to mend it.
  [[nodiscard]] std::string set_parameter(std::string_view component, std::string_view path, double value,
                                          std::string_view unit = "");

  /// Safe stop at the next cycle; see Executor::trip.
  void trip(std::string_view reason) { executor_.trip(reason); }
  void freeze_black_box() noexcept { executor_.freeze_black_box(); }
  void clear_statistics() { executor_.clear_histograms(); }
  /// Shuts all components down, downstream first, and ends the loop.
  void stop();

  [[nodiscard]] Executor& executor() { return executor_; }

 private:
  Outcome request_all(Transition transition);
  [[nodiscard]] std::string unknown(std::string_view component) const;

  Executor& executor_;
  std::mutex turn_;
  RequestLog log_;
};

}  // namespace invar
