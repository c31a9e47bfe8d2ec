#include "core/vision/tiles.hpp"

#include <algorithm>
#include <cstring>

#include "core/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

// Pixels of a tile's row, or sums of such down the tile.
using TileBytes [[gnu::vector_size(tile)]] = std::uint8_t;
using TileWords [[gnu::vector_size(2 * tile)]] = std::uint16_t;

// Of 16 words their sum, which fits one.
inline float total(const TileWords& words) {
  TileWords w = words;
  w += __builtin_shufflevector(w, w, 8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7);
  w += __builtin_shufflevector(w, w, 4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11);
  w += __builtin_shufflevector(w, w, 2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15, 12, 13);
  return static_cast<float>(w[0] + w[1]);
}

// The first pixels of a tile's row; the others are 0.
inline void load(const std::uint8_t* from, int columns, TileBytes& to) {
  if (columns >= tile) {
    std::memcpy(&to, from, sizeof to);
  } else {
    to = TileBytes{};
    std::memcpy(&to, from, static_cast<std::size_t>(columns));
  }
}

// From levels at the middles of the tiles to pixels between them, rounded: 8 bits below the point, in 16. Writes from half a
// tile before the first pixel to the end of a tile; `levels` has one more at either end.
INVAR_WIDE_VECTORS
void interpolate(const float* levels, int columns, std::uint8_t* row) {
  constexpr TileWords ramp{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  for (int i = 0; i <= columns; ++i, row += tile) {
    const int slope = static_cast<int>((levels[i + 1] - levels[i]) * (256.0F / tile));
    const int start = static_cast<int>(levels[i] * 256.0F) + slope / 2 + 128;
    const TileWords words =
        (TileWords{} + static_cast<std::uint16_t>(start) + ramp * static_cast<std::uint16_t>(slope)) >> 8;
    const TileBytes bytes = __builtin_convertvector(words, TileBytes);
    std::memcpy(row, &bytes, sizeof bytes);
  }
}

// The levels of two rows of tiles, mixed.
INVAR_WIDE_VECTORS
void mix(const float* one, const float* other, float share, int length, float* levels) {
  for (int i = 0; i < length; ++i) {
    const float level = one[i] + share * (other[i] - one[i]);
    levels[i] = level < 0.0F ? 0.0F : (level > 255.0F ? 255.0F : level);
  }
}

// row += other * sign
INVAR_WIDE_VECTORS
void add_row(float* row, const float* other, float sign, int length) {
  for (int i = 0; i < length; ++i) row[i] += sign * other[i];
}

}  // namespace

TileSums TileSums::windowed(int reach) const {
  TileSums across{columns_, rows_}, both{columns_, rows_};
  for (int j = 0; j < rows_; ++j) {
    const float* from = row(j);
    float* to = across.row(j);
    float sum = 0.0F;
    for (int k = 0; k < std::min(reach, columns_); ++k) sum += from[k];
    for (int k = 0; k < columns_; ++k) {
      if (k + reach < columns_) sum += from[k + reach];
      if (k - reach - 1 >= 0) sum -= from[k - reach - 1];
      to[k] = sum;
    }
  }
  std::vector<float> sum(static_cast<std::size_t>(columns_), 0.0F);
  for (int j = 0; j < std::min(reach, rows_); ++j) add_row(sum.data(), across.row(j), 1.0F, columns_);
  for (int j = 0; j < rows_; ++j) {
    if (j + reach < rows_) add_row(sum.data(), across.row(j + reach), 1.0F, columns_);
    if (j - reach - 1 >= 0) add_row(sum.data(), across.row(j - reach - 1), -1.0F, columns_);
    std::copy(sum.begin(), sum.end(), both.row(j));
  }
  return both;
}

TileField::TileField(int columns, int rows)
    : columns_{columns},
      rows_{rows},
      values_(static_cast<std::size_t>(columns * rows)),
      levels_(static_cast<std::size_t>(columns + 2)),
      row_(static_cast<std::size_t>(tile * (columns + 1))) {}

const std::uint8_t* TileField::row(int y) {
  const float v =
      std::clamp((static_cast<float>(y) + 0.5F) / tile - 0.5F, 0.0F, static_cast<float>(rows_ - 1));
  const int j = std::min(static_cast<int>(v), std::max(0, rows_ - 2));
  const float share = rows_ > 1 ? v - static_cast<float>(j) : 0.0F;
  mix(&at(0, j), &at(0, std::min(j + 1, rows_ - 1)), share, columns_, levels_.data() + 1);
  levels_.front() = levels_[1];
  levels_.back() = levels_[static_cast<std::size_t>(columns_)];
  interpolate(levels_.data(), columns_, row_.data());
  return last();
}

INVAR_WIDE_VECTORS
void sum_tiles(const TileRows& rows, float* sums) {
  for (int x = 0; x < rows.width; x += tile) {
    TileWords sum{};
    for (int y = 0; y < rows.count; ++y) {
      TileBytes p;
      load(rows.first + static_cast<std::size_t>(y) * rows.stride + x, rows.width - x, p);
      sum += __builtin_convertvector(p, TileWords);
    }
    *sums++ = total(sum);
  }
}

INVAR_WIDE_VECTORS
void sum_beyond(const TileRows& rows, const std::uint8_t* threshold, Beyond side, float* sums,
                float* counts) {
  // Below is above where light and dark change places.
  const auto flip = static_cast<std::uint8_t>(side == Beyond::above ? 0 : 255);
  for (int x = 0; x < rows.width; x += tile) {
    TileBytes limit;
    load(threshold + x, rows.width - x, limit);
    limit ^= flip;
    TileWords sum{};
    TileBytes count{};
    for (int y = 0; y < rows.count; ++y) {
      TileBytes p;
      load(rows.first + static_cast<std::size_t>(y) * rows.stride + x, rows.width - x, p);
      const auto beyond = static_cast<TileBytes>((p ^ flip) > limit);
      sum += __builtin_convertvector(p & beyond, TileWords);
      count -= beyond;
    }
    *sums++ = total(sum);
    *counts++ = total(__builtin_convertvector(count, TileWords));
  }
}

}  // namespace invar::vision
