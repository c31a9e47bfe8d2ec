// Options: how a search is to go.
#pragma once

#include <set>
#include <stop_token>
#include <string>

namespace invar::diagnosis {

/// Is a claim taken back that does not hold on what it has not seen?
enum class Claims { checked, kept };

/// How a search is to go.
struct Options {
  std::set<std::string, std::less<>> without;  // names of terms that are not tried
  bool refuses = true;  // false: claims whatever gains a little, for comparison; nobody should act on it
  [[nodiscard]] Claims claims() const { return refuses ? Claims::checked : Claims::kept; }
  std::stop_token stop;  // once requested, what is known so far is concluded
};

}  // namespace invar::diagnosis
