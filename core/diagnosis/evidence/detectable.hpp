// Detectable: the smallest effect of each term that a recording would have shown.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"

namespace invar::diagnosis {

/// The smallest amplitude of each screened term that would have been seen beside the best model: to first order
/// in its strength, the model's own numbers free beside it. In a time series it must also lead in independent rows and
/// be more than a wander of the noise, as a claim must.
void smallest_effects(const Case& data, const std::vector<Screened>& screened, Diagnosis& d);

}  // namespace invar::diagnosis
