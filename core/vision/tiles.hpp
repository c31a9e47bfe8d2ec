// Tiles of 16 px: what is summed over them and their neighbours, and values between their middles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace invar::vision {

constexpr int tile = 16;  // px a side

/// A sum a tile. The sums are of whole numbers, so exact.
class TileSums {
 public:
  TileSums(int columns, int rows)
      : columns_{columns}, rows_{rows}, cells_(static_cast<std::size_t>(columns * rows), 0.0F) {}
  float& at(int i, int j) { return cells_[static_cast<std::size_t>(j * columns_ + i)]; }
  [[nodiscard]] float at(int i, int j) const { return cells_[static_cast<std::size_t>(j * columns_ + i)]; }
  [[nodiscard]] float* row(int j) { return cells_.data() + j * columns_; }
  [[nodiscard]] const float* row(int j) const { return cells_.data() + j * columns_; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  /// Each with its neighbours, `reach` tiles each way.
  [[nodiscard]] TileSums windowed(int reach) const;

 private:
  int columns_, rows_;
  std::vector<float> cells_;
};

/// A value a tile, read between the tiles' middles by bilinear interpolation, row by row.
class TileField {
 public:
  TileField(int columns, int rows);
  float& at(int i, int j) { return values_[static_cast<std::size_t>(j * columns_ + i)]; }
  /// The row at y, rounded and within 0..255, for comparison with pixels.
  const std::uint8_t* row(int y);
  [[nodiscard]] const std::uint8_t* last() const { return row_.data() + tile / 2; }

 private:
  int columns_, rows_;
  std::vector<float> values_, levels_;
  std::vector<std::uint8_t> row_;  // from half a tile before the first pixel
};

/// Rows of pixels within one row of tiles.
struct TileRows {
  const std::uint8_t* first;
  std::size_t stride;  // from one to the next
  int count, width;
};

/// The sum of the pixels of each tile.
void sum_tiles(const TileRows& rows, float* sums);

/// Sum and count of the pixels of each tile beyond the threshold along the tile's middle: above it, or below.
enum class Beyond { above, below };
void sum_beyond(const TileRows& rows, const std::uint8_t* threshold, Beyond side, float* sums, float* counts);

}  // namespace invar::vision
