// Margins: how much more evidence a claim needs than none.
#pragma once

#include "core/diagnosis/estimate/weighing.hpp"

namespace invar::diagnosis {

/// log evidence by which a term must win before it is claimed; more where many rows would make a trifle significant.
inline constexpr double claim_margin = 10.0;
inline double claim_margin_of(const Weighing& weighing) {
  return claim_margin + weighing.left_of_inputs +
         0.001 * weighing.temper * static_cast<double>(weighing.rows);
}
/// A further claim that hardly moves the size of the residual needs so many times the margin.
inline constexpr double plainly = 3.0;

}  // namespace invar::diagnosis
