// Executor: steps the components of a process once a period, by the clock or in simulated time.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/component/channel.hpp"
#include "core/component/component.hpp"
#include "core/component/lifecycle.hpp"
#include "core/component/parameters.hpp"
#include "core/executor/black_box.hpp"
#include "core/executor/histogram.hpp"
#include "core/executor/options.hpp"
#include "core/executor/pacer.hpp"
#include "core/executor/real_time.hpp"
#include "core/executor/snapshot.hpp"

namespace invar {

struct Slot;

/// How a component stands in its process.
struct Placement {
  std::string type;                             // as registered
  std::vector<ParameterInfo> parameters;        // with handles into `storage`
  std::shared_ptr<void> storage;                // kept alive as long as the component
  std::uint32_t every = 1;                      // stepped each `every`-th period
  std::map<std::string, Duration> latencies{};  // input -> how old its sample may be when a step reads it
  ParameterCheck check{};                       // of changed numbers against each other
};

/// How old the samples of an input were when its component was stepped, by their stamps. Only in real time.
struct InputAge {
  std::string port;
  Duration limit;          // as declared
  std::uint64_t late = 0;  // steps that read an older sample
  Percentiles age;
};

/// Counters of the loop at one moment.
struct LoopCounters {
  std::uint64_t cycle = 0;     // of the newest one; skipped ones count
  Instant now;                 // its nominal start, on the executor's clock
  std::uint64_t executed = 0;  // cycles that ran
  std::uint64_t overruns = 0;  // times at least one period was lost
  std::uint64_t skipped = 0;   // periods in which nothing ran
  std::uint32_t stretch = 1;   // periods from one cycle to the next; above 1: degraded
  std::uint64_t late = 0;      // cycles that ended later than the declared latency allows
  bool tripped = false;        // stopped safely; see trip_reason()
};

/// One change of state, for the publisher of events.
struct StateChange {
  Instant at;
  std::uint32_t component = 0;  // index
  LifecycleState from = LifecycleState::unconfigured;
  LifecycleState to = LifecycleState::unconfigured;
  std::array<char, 160> why{};  // when `to` is error, or it had to leave while it moved
};

/// One process has one executor. Its thread ("the loop") is the only one that steps, activates and
/// deactivates; configure, cleanup and the end run on the thread that asks. Transitions, parameters and
/// stopping may be asked from any thread but the loop's; what only reads is wait-free for the loop and never
/// disturbs it.
///
/// The loop neither allocates nor locks. The loop makes no system call but the one that sleeps, and what `at_cycle_end`
/// makes: one FUTEX_WAKE for each thread that sleeps until a sample comes.
class Executor {
 public:
  explicit Executor(ExecutorOptions options);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  // --- set-up, before start() and before the first advance_to()

  /// Components are stepped in the order in which they are added. Its `name`, topics and connections are set
  /// by the caller, at the latest before the first transition. Returns its index.
  std::size_t add(std::unique_ptr<Component> component, Placement placement = {});
  [[nodiscard]] BlackBox& black_box() { return box_; }
  [[nodiscard]] const ExecutorOptions& options() const { return options_; }
  /// Called by the loop at the end of each cycle, before it sleeps. *Real-time*: it may wake threads, not wait.
  void at_cycle_end(std::function<void()> call) { cycle_ended_ = std::move(call); }

  // --- running by the clock (options.simulated == false)

  /// Starts the loop's thread. Throws InputError when a real-time requirement is not granted and the process
  /// declares `require: true`. Cycles fall on whole multiples of the period of CLOCK_MONOTONIC, so that loops
  /// of one host are in phase.
  void start();
  /// Deactivates what is active, downstream first, and ends the loop. Any thread but the loop's.
  void stop();
  /// The same, without waiting: a signal handler may call it.
  void request_stop() noexcept { stop_requested_.store(true, std::memory_order_release); }
  [[nodiscard]] bool is_running() const noexcept { return running_.load(std::memory_order_acquire); }
  /// The rights that the system granted, once started.
  [[nodiscard]] const std::vector<Grant>& grants() const { return grants_; }

  // --- running in simulated time (options.simulated == true)

  /// Runs every cycle that begins before `until`, on this thread, as fast as it goes; then now() == until.
  /// Cycle k begins at k periods; time begins at 0. The results do not depend on how a span is cut into
  /// calls.
  void advance_to(Instant until);

  // --- any thread but the loop's

  [[nodiscard]] std::size_t size() const { return slots_.size(); }
  [[nodiscard]] const Component& component(std::size_t index) const;
  [[nodiscard]] Component& component(std::size_t index);
  [[nodiscard]] const std::string& type(std::size_t index) const;
  [[nodiscard]] std::uint32_t every(std::size_t index) const;
  /// How often it was stepped.
  [[nodiscard]] std::uint64_t steps(std::size_t index) const;
  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
  /// Upstream before downstream (core/executor/dependency.hpp).
  [[nodiscard]] std::vector<std::size_t> bring_up_order() const;

  /// Carries out one transition of one component and waits for it. Two callers take turns.
  Outcome transition(std::size_t index, Transition transition);
  /// Asks all active components for a controlled stop, so that a later deactivation waits less. Waits for the loop's answer
  /// only.
  void wind_down_all();
  /// Since then: nothing moves any more, or the time for it is over.
  [[nodiscard]] bool is_at_rest() const noexcept { return at_rest_.load(std::memory_order_acquire); }
  /// Hands a new value to the loop and waits until it is applied, between two steps. Empty: done; otherwise
  /// the reason why not.
  [[nodiscard]] std::string set_parameter(std::size_t index, std::string_view path, double value);
  [[nodiscard]] const std::vector<ParameterInfo>& parameters(std::size_t index) const;
  /// The value as the loop applied it last; nothing for what is no changeable number.
  [[nodiscard]] std::optional<double> parameter(std::size_t index, std::string_view path) const;

  /// Stops safely: at the next cycle all active components are deactivated, downstream first, their outputs
  /// get their safe values, and the black box freezes. A moving component first makes a controlled stop; the components that
  /// it reads stay active meanwhile. A component that does not reach standstill in time is deactivated all the same; its change
  /// of state and a second black box say so. Nothing is activated until clear_trip(). Does not wait.
  void trip(std::string_view reason);
  void clear_trip();
  /// Freezes the black box without stopping anything. Does not wait.
  void freeze_black_box() noexcept { freeze_requested_.store(true, std::memory_order_release); }

  /// Time by the clock that stamps carry: UTC (core/base/clock.hpp), or simulated time.
  [[nodiscard]] Instant now() const noexcept;
  [[nodiscard]] LifecycleState state(std::size_t index) const;
  [[nodiscard]] std::string failure(std::size_t index) const;
  [[nodiscard]] std::string trip_reason() const;
  [[nodiscard]] LoopCounters counters() const noexcept { return counters_.read(); }
  [[nodiscard]] HistogramCopy wake_up() const noexcept { return wake_up_.copy(); }
  [[nodiscard]] HistogramCopy compute() const noexcept { return compute_.copy(); }
  [[nodiscard]] HistogramCopy compute(std::size_t index) const;
  /// From when a cycle was due to the end of its work.
  [[nodiscard]] HistogramCopy latency() const noexcept { return latency_.copy(); }
  /// Ages of the inputs whose latency is declared.
  [[nodiscard]] std::vector<InputAge> ages(std::size_t index) const;
  /// Empties the histograms (the counters go on). Waits for the loop.
  void clear_histograms();
  /// The next change of state, oldest first; false: none. One reader.
  bool take_change(StateChange& change);

 private:
  struct Command {
    enum class Kind : std::uint8_t {
      activate,
      deactivate,
      wind_down,
      set_parameter,
      reset_latch,
      clear_histograms,
      clear_trip
    };
    Kind kind = Kind::activate;
    std::uint32_t slot = 0;
    std::uint32_t parameter = 0;
    double value = 0.0;
  };

  // the thread that steps (executor.cpp)
  void run_cycle(Instant now, std::uint64_t cycle, std::uint32_t stretch) noexcept;
  void step(Slot& slot, Instant now, std::uint64_t cycle, std::uint32_t stretch) noexcept;
  void obey(Instant now) noexcept;
  void activate(Slot& slot, Instant now) noexcept;
  void wind_down(Slot& slot, Instant now, bool leave) noexcept;
  void take_down(Instant now) noexcept;
  void deactivate(Slot& slot, Instant now) noexcept;
  [[nodiscard]] bool is_stepped() const noexcept;
  void go_to_error(Slot& slot, std::string_view why, Instant now) noexcept;
  bool inputs_alive(Slot& slot, const Tick& tick) noexcept;
  void watch_ages(Slot& slot, Instant now) noexcept;
  void check_bump(Slot& slot, Instant now) noexcept;
  void stop_safely(std::string_view why, Instant now) noexcept;
  void change_state(Ring<StateChange>& ring, Slot& slot, LifecycleState to, Instant now,
                    std::string_view why = {}) noexcept;
  void close_cycle(Instant now, Duration wake_up, Duration compute) noexcept;
  void deactivate_all(Instant now) noexcept;

  // the loop by the clock (loop.cpp)
  void loop(std::promise<bool>& ready);
  bool sleep_until(Instant due) noexcept;
  void end_loop();

  // the callers of transitions (manager.cpp)
  void prepare();
  Outcome start_or_stop(Slot& slot, Command::Kind kind, LifecycleState target);
  bool carry_out(const Command& command);
  bool wait_for_rest(Slot& slot);
  [[nodiscard]] std::chrono::nanoseconds patience() const;

  ExecutorOptions options_;
  std::function<void()> cycle_ended_;
  std::vector<std::unique_ptr<Slot>> slots_;
  std::vector<std::size_t> take_down_order_;
  BlackBox box_;
  std::vector<Grant> grants_;
  std::once_flag prepared_;
  bool is_prepared_ = false;

  // written by the thread that steps
  Snapshot<LoopCounters> counters_;
  LoopCounters count_;
  std::uint64_t next_cycle_ = 0;
  Histogram wake_up_, compute_, latency_;
  bool late_input_ = false;  // in the current cycle
  bool winding_ = false;     // some component is to come to rest
  std::atomic<bool> at_rest_{true};
  Instant stall_end_{INT64_MIN};
  Duration stall_;
  std::optional<StateChange> next_loop_change_, next_manager_change_;  // the reader's
  Snapshot<std::array<char, 160>> trip_reason_;
  std::atomic<std::int64_t> now_ns_{0};
  std::atomic<std::uint64_t> obeyed_{0};
  Ring<StateChange> loop_changes_{1024}, manager_changes_{1024};

  // asked of it
  Ring<Command> commands_{64};
  std::uint64_t commanded_ = 0;
  std::atomic<bool> stop_requested_{false}, trip_requested_{false}, freeze_requested_{false};
  Snapshot<std::array<char, 160>> requested_reason_;

  std::mutex manager_;  // callers take turns; never taken by the loop while it runs
  std::mutex trip_turn_;
  std::mutex
      stepping_;  // held by the thread that may step: the loop for its whole life, advance_to for its call
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace invar
