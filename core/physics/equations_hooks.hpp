// Actions of a term on a model in the user's own equations: on a state's rate, its bound, or a signal.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

enum class EquationsMemory {
  none,
  dry_friction,
  upper_limit,
  lower_limit,
  overflow,
  delay,
  lag,
  dead_zone,
  hidden_state
};

/// `s` is the variable that the term goes over (`with`: a state, an input or t; left out: the state it acts on).
struct EquationsTermKind {
  const TermInfo* info = nullptr;
  double (*rate)(double s, const double*) = nullptr;  // added to the state's derivative
  EquationsMemory memory = EquationsMemory::none;
};

}  // namespace invar::physics
