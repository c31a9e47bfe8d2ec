#include "core/vision/image_header.hpp"

#include <algorithm>
#include <string_view>

namespace invar::vision {

namespace {

using Bytes = std::span<const unsigned char>;

bool starts_with(Bytes file, std::string_view text) {
  return file.size() >= text.size() &&
         std::equal(text.begin(), text.end(), file.begin(),
                    [](char a, unsigned char b) { return static_cast<unsigned char>(a) == b; });
}

/// A whole number of `size` bytes at `at`; 0 beyond the end.
std::uint64_t number(Bytes file, std::uint64_t at, unsigned size, bool big_endian) {
  if (at > file.size() || file.size() - at < size) return 0;
  std::uint64_t value = 0;
  for (unsigned i = 0; i < size; ++i) value = value << 8U | file[at + (big_endian ? i : size - 1 - i)];
  return value;
}

ImageHeader png(Bytes file) {
  constexpr std::uint64_t width = 16, height = 20, depth = 24, colour = 25;
  const auto kind = number(file, colour, 1, true);
  const std::uint64_t channels = kind == 2 || kind == 3 ? 3 : kind == 4 ? 2 : kind == 6 ? 4 : 1;
  return {number(file, width, 4, true), number(file, height, 4, true),
          channels * (number(file, depth, 1, true) > 8 ? 2U : 1U)};
}

ImageHeader jpeg(Bytes file) {
  for (std::uint64_t at = 2; at + 9 < file.size();) {
    if (file[at] != 0xFF) return {};
    const unsigned marker = file[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame)
      return {number(file, at + 7, 2, true), number(file, at + 5, 2, true), number(file, at + 9, 1, true)};
    const bool alone = marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8);
    at += alone ? 2 : 2 + number(file, at + 2, 2, true);
  }
  return {};
}

/// The first directory alone: it is the picture that is read.
ImageHeader tiff(Bytes file) {
  constexpr unsigned width = 256, height = 257, depth = 258, channels = 277, tile_width = 322,
                     tile_height = 323;
  const bool big = file[0] == 'M';
  const auto directory = number(file, 4, 4, big);
  ImageHeader header{0, 0, 1};
  std::uint64_t samples = 1, bits = 8, tile_x = 0, tile_y = 0;
  const auto entries = number(file, directory, 2, big);
  for (std::uint64_t i = 0; i < entries; ++i) {
    const std::uint64_t at = directory + 2 + 12 * i;
    const auto tag = number(file, at, 2, big);
    const bool is_short = number(file, at + 2, 2, big) == 3;
    const auto count = number(file, at + 4, 4, big);
    auto value = number(file, at + 8, is_short ? 2 : 4, big);
    if (tag == width) header.width = value;
    if (tag == height) header.height = value;
    if (tag == channels) samples = value;
    if (tag == tile_width) tile_x = value;
    if (tag == tile_height) tile_y = value;
    if (tag == depth)
      bits = is_short && count > 2 ? number(file, number(file, at + 8, 4, big), 2, big) : value;
  }
  header.width = std::max(header.width, tile_x);  // a tile is decoded as a whole
  header.height = std::max(header.height, tile_y);
  header.pixel_bytes = std::max<std::uint64_t>(samples, 1) * std::max<std::uint64_t>((bits + 7) / 8, 1);
  return header;
}

ImageHeader bmp(Bytes file) {
  const auto whole = [&](std::uint64_t at) {
    const auto value = static_cast<std::int32_t>(number(file, at, 4, false));
    return static_cast<std::uint64_t>(value < 0 ? -std::int64_t{value} : std::int64_t{value});
  };
  if (number(file, 14, 4, false) == 12) return {number(file, 18, 2, false), number(file, 20, 2, false), 3};
  return {whole(18), whole(22), number(file, 28, 2, false) == 32 ? 4U : 3U};
}

/// "P5 640 480 255", with comments up to the end of a line.
ImageHeader netpbm(Bytes file) {
  std::uint64_t numbers[3] = {0, 0, 1};
  const std::size_t wanted = file[1] == '1' || file[1] == '4' ? 2 : 3;
  std::size_t at = 2;
  for (std::size_t n = 0; n < wanted; ++n) {
    while (at < file.size() && (file[at] < '0' || file[at] > '9')) {
      if (file[at] == '#')
        while (at < file.size() && file[at] != '\n') ++at;
      if (at < file.size()) ++at;
    }
    std::uint64_t value = 0;
    for (; at < file.size() && file[at] >= '0' && file[at] <= '9' && value < (1ULL << 32U); ++at)
      value = 10 * value + (file[at] - '0');
    numbers[n] = value;
  }
  const std::uint64_t channels = file[1] == '3' || file[1] == '6' ? 3 : 1;
  return {numbers[0], numbers[1], channels * (numbers[2] > 255 ? 2U : 1U)};
}

}  // namespace

std::optional<ImageHeader> image_header(Bytes file) {
  using namespace std::string_view_literals;
  ImageHeader header;
  if (starts_with(file, "\x89PNG\r\n\x1a\n"sv))
    header = png(file);
  else if (starts_with(file, "\xff\xd8"sv))
    header = jpeg(file);
  else if (starts_with(file, "II\x2a\0"sv) || starts_with(file, "MM\0\x2a"sv))
    header = tiff(file);
  else if (starts_with(file, "BM"sv))
    header = bmp(file);
  else if (file.size() > 2 && file[0] == 'P' && file[1] >= '1' && file[1] <= '6')
    header = netpbm(file);
  if (header.width == 0 || header.height == 0 || header.pixel_bytes == 0) return std::nullopt;
  return header;
}

}  // namespace invar::vision
