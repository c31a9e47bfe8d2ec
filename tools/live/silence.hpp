// Silence: processes of a cell that were heard and are no more.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "idl/lifecycle.h"

namespace invar::tools {

/// A process whose status does not get newer for three seconds is silent.
class Silence {
 public:
  std::set<std::string> of(const std::vector<lifecycle::ProcessStatus>& processes) {
    std::set<std::string> silent;
    const auto now = std::chrono::steady_clock::now();
    for (const auto& process : processes) {
      auto& last = last_[process.process_name().c_str()];
      const std::pair stamp{process.at().time_ns(), process.cycles()};
      // In simulated time the cell's clock may stand while its processes wait: cycles do not count there.
      if (last.first != stamp || process.simulated()) last = {stamp, now};
      if (now - last.second > std::chrono::seconds{3}) silent.insert(process.process_name().c_str());
    }
    return silent;
  }

 private:
  std::map<std::string,
           std::pair<std::pair<std::int64_t, std::uint64_t>, std::chrono::steady_clock::time_point>>
      last_;
};

}  // namespace invar::tools
