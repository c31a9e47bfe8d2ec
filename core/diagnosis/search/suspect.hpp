// Where a cause sits that neither a name nor a curve describes.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// The place at which one curve, or a reading that comes late, would explain most of the residual under the present weights.
/// The curve goes over any one variable; it need not explain enough for a claim.
Suspect most_suspect(const Case& data, const Diagnosis& d);

}  // namespace invar::diagnosis
