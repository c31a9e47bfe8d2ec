// The diagnosis: which physics, if any, must be added to the model to explain the recordings.
#pragma once

#include "core/diagnosis/search/search.hpp"

namespace invar::diagnosis {

/// Which physics does `data.model` leave out of the recordings? `data` is cleaned on the way, and is the reading of the
/// recordings that the diagnosis stands on. Deterministic. Where `options.stop` says so the search ends with what is known.
Diagnosis diagnose(Case& data, const Progress& progress, const Options& options = {});

}  // namespace invar::diagnosis
