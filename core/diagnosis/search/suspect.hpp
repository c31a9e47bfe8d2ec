// Where a cause sits that neither a name nor a curve describes.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// The place at which a curve over any one variable, or a reading that comes late, would explain most of what is left
/// under the present weights, enough to claim it or not.
Suspect most_suspect(const Case& data, const Diagnosis& d);

}  // namespace invar::diagnosis
