// Margins: how much more evidence a claim needs than none.
#pragma once

#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

inline double claim_margin_of(const Weighing& weighing) {
  return thresholds::claim_margin + weighing.left_of_inputs +
         thresholds::margin_by_row * weighing.temper * static_cast<double>(weighing.rows);
}

}  // namespace invar::diagnosis
