// Options: how a search is to go.
#pragma once

#include <functional>
#include <set>
#include <string>

namespace invar::diagnosis {

/// How a search is to go.
struct Options {
  std::set<std::string, std::less<>> without;  // names of terms that are not tried
  bool refuses = true;  // false: claims whatever gains a little, for comparison; nobody should act on it
  std::function<bool()> stopped;  // asked between fits; once true, what is known so far is concluded
};

}  // namespace invar::diagnosis
