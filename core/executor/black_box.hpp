// The black box: the last N cycles and chosen numbers, frozen on a trip and handed to another thread.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/base/time.hpp"
#include "core/component/component.hpp"

namespace invar {

/// One cycle as the loop saw it.
struct CycleRecord {
  std::uint64_t cycle = 0;
  Instant due;                              // the nominal start, in the executor's clock
  Duration wake_up;                         // how late the loop woke
  Duration compute;                         // from waking to the end of the work
  std::uint64_t overruns = 0, skipped = 0;  // so far
  std::array<LifecycleState, 32> states{};  // of the first 32 components, in file order
};

/// The record of a trip: oldest cycle first; `samples` has one row a cycle, one column a signal.
struct BlackBoxRecord {
  struct Signal {
    std::string name;
    std::string unit;
  };
  std::string process;
  std::string reason;
  Instant tripped_at;
  std::uint64_t tripped_cycle = 0;
  std::vector<std::string> components;
  std::vector<Signal> signals;
  std::vector<CycleRecord> cycles;
  std::vector<double> samples;  // cycles.size() * signals.size(), row after row
};

class BlackBox {
 public:
  explicit BlackBox(std::uint32_t cycles) : capacity_{cycles} {}
  BlackBox(const BlackBox&) = delete;
  BlackBox& operator=(const BlackBox&) = delete;
  ~BlackBox() { stop(); }

  /// Set-up only. `value` is called on the loop's thread at the end of each cycle: it must be real-time.
  void watch(std::string name, std::string unit, std::function<double()> value);
  /// Set-up only: who gets the record of each trip, on a thread of the black box (in simulated time: on the
  /// thread that calls advance_to, at its end).
  void on_trip(std::function<void(const BlackBoxRecord&)> callback) { callback_ = std::move(callback); }

  /// Set-up: takes the memory. `threaded` starts the thread that calls back.
  void start(std::string process, std::vector<std::string> components, bool threaded);
  /// Ends the thread and hands over what is left.
  void stop();
  /// Hands over a frozen record now, if there is one. `loop_ended`: also one whose last cycles did not come any
  /// more. Not on the loop's thread.
  void deliver(bool loop_ended = false);

  /// By the loop, real-time: one more cycle. Nothing while frozen.
  void add(const CycleRecord& record) noexcept;
  /// By the loop, real-time: freezes after a few more cycles (an eighth of the ring), so that the record
  /// shows what the trip led to. The reason is `prefix` + `why`; the first one wins.
  void trip(std::string_view prefix, std::string_view why, Instant now, std::uint64_t cycle) noexcept;

 private:
  std::uint32_t capacity_;
  std::vector<BlackBoxRecord::Signal> signals_;
  std::vector<std::function<double()>> values_;
  std::vector<std::string> components_;
  std::string process_;
  std::function<void(const BlackBoxRecord&)> callback_;

  // the loop's
  std::vector<CycleRecord> ring_;
  std::vector<double> samples_;
  std::uint64_t written_ = 0;
  bool tripped_ = false;
  std::uint32_t left_ = 0;
  std::array<char, 160> reason_{};
  Instant tripped_at_;
  std::uint64_t tripped_cycle_ = 0;

  std::atomic<bool> frozen_{false};  // true: the ring belongs to the reader
  std::mutex delivering_;            // neither is ever taken by the loop
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace invar
