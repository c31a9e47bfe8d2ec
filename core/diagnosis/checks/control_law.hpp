// Does the recorded current follow from the recorded reference and position by the controller of the model? Gains are typed
// in by hand, and with a wrong one every cause that is named behind the loop is wrong too.
#pragma once

#include <optional>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// By row of one recording [A]: the current that the model's law makes of the readings, whatever its limit, and what the
/// recorded current is beyond that. NaN where cycles are lost, where the current is at its limit and until the law's
/// filter has settled. A law with a sum begins as the model does. Behind a gap, and where the loop has run before, its sum is
/// unknown, and the current beyond the law has the mean zero.
struct LawRows {
  std::vector<double> asked, beyond;
  bool has_open_level = false;  // of a part
};
/// Where the current is recorded behind what acts on it, what the model's own terms make of the command is counted to the law.
/// By recording; empty of a plant without a controller, where position or current is not recorded, and where the model itself
/// holds back what is recorded.
std::vector<LawRows> rows_of_law(const Case& data);

struct LawOff {
  double off = 0.0;  // [A] RMS of what the law leaves of the current and goes with the motion
  double all = 0.0;  // [A] RMS of the current's changes
  double share =
      1.0;  // of the mismatch of the position: so much goes away in a loop that is told what its law leaves
  /// So much that what is named behind the loop may be wrong: made loops with the model's law stay under a hundredth.
  [[nodiscard]] bool is_another_law() const { return off > 0.05 * all; }
  /// Most of the mismatch: what lies behind the loop cannot be judged. A drive that smooths its reference is off its law by
  /// much of the current, and yet by little of what the plant does unlike the model.
  [[nodiscard]] bool is_chief() const { return is_another_law() && share > 0.5; }
  [[nodiscard]] bool is_beside() const { return is_another_law() && !is_chief(); }
};

/// The current beside the law, as far as it goes with the motion that the model expects, which is free of the noise of the
/// readings. Readings that the controller did not see in the same way, or a current with noise of its own, are no
/// other law (instrumental variables, Soderstrom and Stoica 1983). Found on a half of the blocks of rows, counted on the
/// other half. Nothing without a controller, or where the recordings have too few cycles in a row. `share` is left alone.
std::optional<LawOff> off_the_law(const Case& data);

/// The same recordings, with the current beside the law given to each loop as a feedforward. The loop departs from its law
/// as the machine did, so that the residual is the plant's.
Case told_what_law_leaves(const Case& data, const std::vector<LawRows>& rows);
/// The share of the squares that a model leaves of the position which goes away in that loop: 0 to 1.
double share_of_law(const Case& data, const physics::Model& retuned);

}  // namespace invar::diagnosis
