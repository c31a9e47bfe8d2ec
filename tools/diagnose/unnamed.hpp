// Physics without a name: a curve over one variable, beside the named terms or instead of them.
#pragma once

#include "tools/diagnose/other_cause.hpp"

namespace invar::diagnose {

/// Adds a curve as a finding where one is plainly needed. One that explains far more than the named terms takes their
/// place. `beside_best` is that of the best model.
void add_unnamed(const Case& data, Diagnosis& d, const Beside& beside_best);

/// Puts a curve in the place of names for which another cause is far likelier (`unlikely_odds`), where it does better; the
/// nearest name stays as its alternative. False: nothing changed.
bool set_aside(const Case& data, Diagnosis& d);

}  // namespace invar::diagnose
