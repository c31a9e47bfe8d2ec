// Noise on a recorded input: the machine never felt it, and what takes it back looks like physics.
#pragma once

#include <optional>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// Levels with noise on them look like a dead zone, a limit or a course over the input. Most readings near a level are off
/// towards where the noise took them (errors in variables: Fuller, Measurement Error Models, 1987). The running median
/// takes such noise away and leaves steps where they are.
/// Where the refitted model lies nearer with the inputs so quietened and a claim of `d` gains little there: `as_read` with
/// these inputs, to be diagnosed in its place. `judged`: the case that `d` was found in.
std::optional<Case> with_quiet_inputs(const Case& as_read, const Case& judged, const Diagnosis& d);

}  // namespace invar::diagnosis
