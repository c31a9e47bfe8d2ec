// Blocked cross-validation: how two models foretell quarters of the recordings that no fit saw.
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

struct Foretold {
  double share = 0.0;      // of the squares that `without` leaves in all quarters, in units of the noise
  std::size_t better = 0;  // quarters in which `with` leaves less
  std::size_t quarters = 0;

  /// By a share that an engineer would see, and in all quarters but one: that is no chance, whatever the colour of the noise.
  [[nodiscard]] bool is_plain() const;
};

/// Each quarter of each recording in turn is kept from both fits, which are begun from where they stand. Where states begin anew
/// within recordings the quarters are later halves of stretches. Nothing (no quarter) where there are too few of those.
Foretold foretold(const Case& data, const Fit& with, const Fit& without);

}  // namespace invar::diagnosis
