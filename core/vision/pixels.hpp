// Grey pictures as plain numbers, the form in which they pass between components and the vision library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace invar::vision {

/// Pixels that belong to somebody else, row by row without gaps.
struct PixelsView {
  int width = 0, height = 0;  // px
  bool wide = false;          // 16 bits a pixel, otherwise 8
  const std::uint8_t* bytes = nullptr;
};

struct Pixels {
  int width = 0, height = 0;  // px
  bool wide = false;          // 16 bits a pixel, otherwise 8
  std::vector<std::uint8_t> bytes;

  [[nodiscard]] PixelsView view() const { return {width, height, wide, bytes.data()}; }
};

}  // namespace invar::vision
