// The table that `invar run` ends with, and the report of a calibration job.
#pragma once

#include <nlohmann/json.hpp>
#include <ostream>

#include "tools/cell/launcher.hpp"

namespace invar::tools {

/// Prints what became of the processes, their loops and the job, and writes report.html beside the results of a job that is
/// done. Returns the same for programs.
nlohmann::ordered_json summarise(const LaunchOutcome& outcome, std::ostream& out);

}  // namespace invar::tools
