// Settings of this PC that would hurt a cell: one finding a thing looked at.
#pragma once

#include <string>
#include <vector>

namespace invar::tools {

struct Finding {
  enum class Level { good, note, bad };
  Level level = Level::good;
  std::string what;   // looked at
  std::string state;  // how it is
  std::string mend;   // empty where it is good
};

/// Looks and changes nothing; needs no rights.
[[nodiscard]] std::vector<Finding> check_host();

}  // namespace invar::tools
