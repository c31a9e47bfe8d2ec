// Candidates: which terms could act in this machine, where, and from which shapes a fit of them begins.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// All named terms that the signals of the case allow, on top of `fitted`, but those in `without`.
std::vector<Start> named_starts(const Case& data, const Weighing& weighing, const Fit& fitted,
                                const std::set<std::string, std::less<>>& without);
/// Curves over each variable, for what no name describes.
std::vector<Start> unmodelled_starts(const Case& data, const Fit& fitted);
/// Curves with memory, for hysteresis and what creeps.
std::vector<Start> memory_starts(const Case& data, const Fit& fitted);

}  // namespace invar::diagnosis
