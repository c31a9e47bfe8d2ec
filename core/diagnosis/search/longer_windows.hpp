// Short windows hide slow effects: each begins at states of its own, before anything slow shows.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// Where a verdict leaves nothing open that was found in short windows, the best model must hold in longer ones too
/// (`Case::Windows::are_long`), its numbers fitted anew. A residual there beyond twice the instruments' noise is mismatch: the
/// verdict leaves it open, and `data.doubts` says so. `as_read`: the recordings before they were cut; `data`: the case that `d` was
/// found in.
void hold_to_longer_windows(const Case& as_read, Case& data, Diagnosis& d);

}  // namespace invar::diagnosis
