// LoopWatch: whether an axis' loop is at its current limit, or swings, while a job moves it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "idl/stage.h"

namespace invar::calibration {

/// Looks at every state of a motion until the axis has settled. A current that is clamped reads the same again and again, which
/// one that the law works out freely does not: so the limit need not be known.
class LoopWatch {
 public:
  void reset() { *this = {}; }
  /// The newest state; one that was taken already is passed over.
  void take(const stage::AxisState& state);
  /// Why the motion is worth nothing, with the figure; nothing: it is sound.
  [[nodiscard]] std::optional<std::string> fault() const;
  /// Addition to the notice that the loop tripped or does not settle: "; <figures>", or "".
  [[nodiscard]] std::string figures() const;

 private:
  [[nodiscard]] double share_at_limit() const;
  [[nodiscard]] std::string at_limit() const;
  [[nodiscard]] std::string swing() const;

  std::int64_t taken_at_ = 0;  // ns
  std::int64_t samples_ = 0;
  double highest_ = 0.0;  // current so far [A]
  std::int64_t at_highest_ = 0;
  double last_error_ = 0.0, largest_error_ = 0.0;  // following error [m]
  int crossings_ = 0;                              // of zero
  std::int64_t first_crossing_ = 0, last_crossing_ = 0;
};

/// The component that writes a topic cell/<cell>/<component>/<port>; "axis x" where the port has none.
[[nodiscard]] std::string axis_name(const std::string& topic, std::int64_t axis);

}  // namespace invar::calibration
