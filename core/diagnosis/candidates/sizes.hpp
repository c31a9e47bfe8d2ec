// Sizes by which candidates are laid: how large signals usually are, and whether friction was found already.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// RMS of all finite values; 0 where there are none.
double rms_of(const std::vector<std::vector<double>>& series);
/// RMS of a signal over all recordings, at least a billionth.
double usual_size(const Case& data, const std::string& signal);
/// A tenth of the current that the motor of an axis usually takes [A], and the force of it [N].
double small_current(const Case& data);
double small_force(const Case& data, const physics::Model& model);
/// Does the model hold a law of friction that the user did not write?
bool has_found_friction(const Case& data, const physics::Model& model);

}  // namespace invar::diagnosis
