// The faults of one file: each place once, and of one kind no more than somebody reads.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/fault.hpp"

namespace invar::config {

/// One cause may make thousands of faults, as a list of words where numbers belong. The first twenty of a kind are kept, the
/// rest is counted. Faults are of one kind where they say the same but for what stands in backticks and for numbers.
class FaultList {
 public:
  void add(Fault fault);
  /// One that another fault explains, if it was added.
  void withdraw(const std::string& where, const std::string& what);
  /// How many were added, each place and fault once.
  [[nodiscard]] std::size_t count() const { return seen_.size(); }
  /// Those kept, in order; for each kind with more, one that says how many.
  [[nodiscard]] std::vector<Fault> all() const;

 private:
  std::set<std::pair<std::string, std::string>> seen_;  // where, what
  std::map<std::string, std::size_t> kinds_;            // how many of each
  std::map<std::string, Fault> first_beyond_;           // the first of a kind that is only counted
  std::vector<Fault> kept_;
};

}  // namespace invar::config
