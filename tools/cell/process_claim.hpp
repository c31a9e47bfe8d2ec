// ProcessClaim: one process of a cell runs once on a PC. A name in the kernel (an abstract socket, unix(7)), which goes with
// the process however it ends.
#pragma once

#include <string>

#include "core/config/cell.hpp"

namespace invar::tools {

class ProcessClaim {
 public:
  /// Throws InputError where the same process of the same cell runs already.
  ProcessClaim(const config::Cell& cell, const std::string& process);
  ~ProcessClaim();
  ProcessClaim(const ProcessClaim&) = delete;
  ProcessClaim& operator=(const ProcessClaim&) = delete;

 private:
  int socket_ = -1;
};

}  // namespace invar::tools
