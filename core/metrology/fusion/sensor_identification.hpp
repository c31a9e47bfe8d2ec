// The structure of each sensor - step, offset, delay, hysteresis; gain over speed, lag, colour of noise - from runs.
#pragma once

#include <string>
#include <vector>

#include "core/metrology/fusion/fusion_runs.hpp"

namespace invar::metrology {

/// Parameters that the runs leave open are added to `unidentified`, where that is given.
FusionModel identify_sensors(const std::vector<FusionRun>& runs, std::vector<std::string> position_names,
                             std::vector<std::string> velocity_names, std::vector<std::string>* unidentified);

}  // namespace invar::metrology
