// The search: which physics, if any, must be added to the model to explain the recordings.
#pragma once

#include <functional>
#include <string>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/options.hpp"

namespace invar::diagnosis {

/// `progress` is told a share in 0..1 and what is being done.
Diagnosis search(Case& data, const std::function<void(double, const std::string&)>& progress,
                 const Options& options = {});

}  // namespace invar::diagnosis
