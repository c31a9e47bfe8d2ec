// Why a command to an axis is refused: numbers that are none, and an axis that cannot take it now.
#pragma once

#include "core/base/range.hpp"
#include "idl/stage.h"

namespace invar::stage {

/// A number of a command that no axis could carry out. Real-time.
struct NumberFault {
  const char* member = nullptr;  // nullptr: all numbers that this kind of command uses are sound
  double value = 0.0;
  const char* want = "";
};
[[nodiscard]] NumberFault fault_in(const AxisCommand& command) noexcept;

/// Why an axis in this state refused a command whose numbers are sound. A literal. Real-time.
[[nodiscard]] const char* why_refused(const AxisCommand& command, AxisMode mode, bool homed,
                                      const Range& travel) noexcept;

/// "a move", "homing"; for messages.
[[nodiscard]] const char* kind_text(AxisCommandKind kind) noexcept;

}  // namespace invar::stage
