// At which frequencies a part that swings on an axis's carriage would explain most of the residual.
#pragma once

#include <vector>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// [Hz] The likeliest natural frequencies of a flexible mode, best first, to first order in its mass; mass and damping of
/// the carriage give way. Empty where the position is no output. `responses`: of the whitened residual to a pulse of force,
/// by output; `back`: the residual carried back to the force, by recording.
std::vector<double> mode_frequencies(const Case& data, const Fit& fitted,
                                     const std::vector<std::vector<double>>& responses,
                                     const std::vector<std::vector<double>>& back);

}  // namespace invar::diagnosis
