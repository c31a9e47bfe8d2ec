// The model that is handed over simulates no worse than the given one, and holds no term without an effect.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// Is the RMS `one` of an output larger than its RMS `than` by more than chance and the noise allow?
bool is_worse(double one, double than, double noise);

/// Which models of a row are compared.
using OfModel = double FitRow::*;
/// Is a model worse than another: an output is, and the others do not make up for it.
bool is_worse(const std::vector<FitRow>& fit, OfModel one, OfModel than);

/// Leaves out the found terms whose sizes are zero or which explain nothing of the mismatch; the others are fitted anew.
/// False: there was none.
bool leave_out_nothings(const Case& data, Diagnosis& d);

/// Takes the last finding back and fits the rest anew; `why` goes to what was rejected.
void take_last_back(const Case& data, Diagnosis& d, const std::string& why);

}  // namespace invar::diagnosis
