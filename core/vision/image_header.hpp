// How large an image says it is, read from the head of its file before anything decodes it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace invar::vision {

struct ImageHeader {
  std::uint64_t width = 0, height = 0;
  std::uint64_t pixel_bytes = 1;  // channels times bytes of each
  [[nodiscard]] std::uint64_t bytes() const { return width * height * pixel_bytes; }
};

/// Header of PNG, JPEG, TIFF, BMP and PGM (also PBM, PPM). Empty for another format, or a header that is cut or states no size.
std::optional<ImageHeader> image_header(std::span<const unsigned char> file);

}  // namespace invar::vision
