// The search: which physics, if any, must be added to the model to explain the recordings.
#pragma once

#include <functional>
#include <set>
#include <string>

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

/// How a search is to go.
struct Options {
  std::set<std::string, std::less<>> without;  // names of terms that are not tried
  bool refuses = true;  // false: claims whatever gains a little, for comparison; nobody should act on it
  std::function<bool()> stopped;  // asked between fits; once true, what is known so far is concluded
};

/// `progress` is told a share in 0..1 and what is being done.
Diagnosis search(Case& data, const std::function<void(double, const std::string&)>& progress,
                 const Options& options = {});

}  // namespace invar::diagnose
