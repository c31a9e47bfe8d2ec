// Whether a process of this PC runs.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace invar::dds {

/// Not when it has ended and its parent does not know it yet.
inline bool is_alive(std::int32_t pid) {
  std::ifstream stat{"/proc/" + std::to_string(pid) + "/stat"};
  std::string text;
  std::getline(stat, text);
  const auto name_end = text.rfind(") ");
  return name_end != std::string::npos && text[name_end + 2] != 'Z' && text[name_end + 2] != 'X';
}

}  // namespace invar::dds
