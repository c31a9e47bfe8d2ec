// Slot: one component's place in its executor. Inside core/executor only.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/component/standby.hpp"
#include "core/executor/histogram.hpp"
#include "core/executor/snapshot.hpp"

namespace invar {

using FailureText = std::array<char, 160>;
inline FailureText failure_text(std::string_view text) noexcept {
  FailureText out{};
  std::copy_n(text.data(), std::min(text.size(), out.size() - 1), out.data());
  return out;
}

struct Slot {
  /// A standby writes nothing: its safe values would switch off what the other drives.
  void write_safe_values() const noexcept {
    for (OutputPort* output : outputs) output->write_safe_value();
  }
  [[nodiscard]] bool commands() const noexcept { return standby == nullptr || standby->leads(); }

  std::shared_ptr<void> storage;  // the parameters; the component refers to them and goes first
  std::unique_ptr<Component> component;
  std::string type;
  std::uint32_t every = 1;
  std::size_t index = 0;

  std::vector<ParameterInfo> infos;
  ParameterCheck check;
  std::deque<std::atomic<double>> values;  // beside infos: what the loop applied last, for readers

  struct Deadline {
    const InputPort* input;
    std::string failure;  // "input `raw` lost: ..."
  };
  std::vector<Deadline> deadlines;
  struct Age {
    const InputPort* input;
    Duration limit;
    Histogram age;
    std::atomic<std::uint64_t> late{0};
  };
  std::deque<Age> ages;  // inputs whose latency is declared
  std::vector<OutputPort*> outputs;
  const Standby* standby = nullptr;  // where another component can stand by for it
  std::string error_prefix;          // "stage: ", for the black box

  // Written by the thread that steps while active, by the caller of a transition otherwise; read by anybody.
  std::atomic<LifecycleState> state{LifecycleState::unconfigured};
  Snapshot<FailureText> failure;
  Histogram compute;
  std::atomic<std::uint64_t> steps{0};

  // The stepping thread's own.
  std::uint64_t next_due = 0;
  bool bump_checked = true;
  bool parameters_dirty = false;
  Instant active_since;
  bool winding = false;  // asked to come to rest, at the latest by `leave_by`
  bool leaving = false;  // to be deactivated once neither it nor what reads its signals moves
  bool braking = false;
  Instant leave_by;
  std::vector<Slot*> signalled;  // whom its signals reach, directly or through others
};

}  // namespace invar
