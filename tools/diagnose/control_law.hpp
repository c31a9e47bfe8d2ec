// Does the recorded current follow from the recorded reference and position by the controller of the model? Gains are typed
// in by hand, and with a wrong one every cause that is named behind the loop is wrong too.
#pragma once

#include <optional>

#include "tools/diagnose/fit.hpp"

namespace invar::diagnose {

struct LawOff {
  double off = 0.0;  // [A] RMS of what the law leaves of the current and goes with the motion
  double all = 0.0;  // [A] RMS of the current's changes
  /// So much that what is named behind the loop would be wrong: made loops with the model's law stay under a hundredth.
  [[nodiscard]] bool is_another_law() const { return off > 0.05 * all; }
};

/// What the law leaves of the recorded current, as far as it goes with the motion that the model expects, which is free of the
/// noise of the readings: readings that the controller did not see in the same way, or a current with noise of its own, are no
/// other law (instrumental variables, Soderstrom and Stoica 1983). Found on a half of the blocks of rows, counted on the
/// other half. Nothing without a controller, or where the recordings have too few cycles in a row.
std::optional<LawOff> off_the_law(const Case& data);

}  // namespace invar::diagnose
