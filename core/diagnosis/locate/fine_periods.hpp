// Periods of what repeats along a state of own equations, however often: from what the readings say of its rate.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// The rate of `state` as the residual asks for it, by recording and row, up to a factor; `push` is a small one. A recording
/// too short to tell has none.
std::vector<std::vector<double>> rate_asked_for(const Case& data, const physics::Model& fitted,
                                                const std::string& state, double push);

/// That rate added up by where the state `over` was: the waves that stand out of it, strongest first, at most `most`. In the
/// unit of `over`; nothing where it goes too few waves to tell.
std::vector<double> fine_periods(const Case& data, const physics::Model& fitted,
                                 const std::vector<std::vector<double>>& asked, const std::string& over,
                                 std::size_t most);

}  // namespace invar::diagnosis
