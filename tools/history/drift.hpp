// Drift: what moved between calibrations, and when the next one is due.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/history/calibrations.hpp"

namespace invar::tools {

/// One number over all calibrations.
struct NumberHistory {
  CalibratedNumber last;
  std::vector<double> values, sigmas;
  double moved = 0.0;  // last less first
  double sigma = 0.0;  // of `moved`; NaN: not known
  double rate = 0.0;   // [1/s], by a line through all
  double rate_sigma = 0.0;
  double wander = 0.0;  // variance a second beyond the line and the sigmas
  double chance = 1.0;  // that noise alone moves it so far; 1 where sigma is not known
};

/// All numbers of one name: of EXX at every place.
struct NameHistory {
  std::string name, unit;
  bool is_error = false;
  std::vector<NumberHistory> numbers;
  std::size_t farthest = 0;  // the number that moved by most of its sigma
  double moved_rms = 0.0;
  /// Moved: chance alone would not (1 in 100 over all places of the name). Within sigma: less than it at every place.
  enum class Verdict { moved, more_than_sigma, still, not_known } verdict = Verdict::not_known;
};

struct Due {
  bool known = false;
  double after = 0.0;  // s after the last calibration; infinite: nothing moves
  std::string by;      // the name that asks for it first
  double left = 0.0;   // two sigma of that name right after the last calibration
};

/// `numbers` as `comparable_numbers` gives them, at `times` [s].
std::vector<NameHistory> histories_of(const std::vector<std::vector<CalibratedNumber>>& numbers,
                                      const std::vector<double>& times);

/// The time at which the error of some name, two sigma, reaches `accuracy`. It is the error of the last calibration, plus the drift
/// since then by the line (with the sigma of its rate), plus the wander beyond the line. RMS over the places. Needs two calibrations.
Due due_for(const std::vector<NameHistory>& names, double accuracy);

}  // namespace invar::tools
