// Does what a model leaves over still follow what was recorded? Asked without any idea of the form.
#pragma once

#include "tools/diagnose/fit.hpp"

namespace invar::diagnose {

/// By output, the share of the power of measured - simulated that a surface of second order over all inputs, their
/// motion and their past explains beyond what it explains of the same series shifted against the recording: chance and
/// the colour of the noise are in both. 0 where it is no more than chance.
std::vector<double> followed_share(const Case& data, const physics::Model& model);

}  // namespace invar::diagnose
