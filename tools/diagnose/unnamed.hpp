// Physics without a name: a curve over one variable, beside the named terms or instead of them.
#pragma once

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

/// Adds a curve as a finding where one is plainly needed. One that explains far more than the named terms takes their
/// place.
void add_unnamed(const Case& data, Diagnosis& d);

}  // namespace invar::diagnose
