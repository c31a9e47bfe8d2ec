// How large a number may be of which the user knows nothing: 0 stands there, and no sigma.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Writes `usual` of such parameters and amplitudes of terms in the model: what changes the recording about as much as the
/// model errs. A fit takes its steps from there; of 0 alone nobody could say whether newtons or micronewtons are meant.
void find_unknown_sizes(Case& data);

}  // namespace invar::diagnosis
