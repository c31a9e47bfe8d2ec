// How a chunk of a recording is packed: not at all, by LZ4 or by Zstandard; and the CRC-32 that guards it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "core/recording/bytes.hpp"

namespace invar::recording {

enum class Compression : std::uint8_t { none, lz4, zstd };

/// "" , "lz4" or "zstd", as MCAP spells them.
std::string_view name_of(Compression compression);
std::optional<Compression> compression_named(std::string_view name);

/// CRC-32 as zlib and MCAP define it (polynomial 0x04C11DB7, reflected). `so_far` continues an earlier block.
std::uint32_t crc32_of(ByteView bytes, std::uint32_t so_far = 0);

/// Packs blocks into frames of their own; keeps its working memory between calls. One thread at a time.
class Packer {
 public:
  /// `level` is Zstandard's (1 fastest); LZ4 ignores it.
  explicit Packer(Compression compression, int level = 1);
  ~Packer();
  Packer(const Packer&) = delete;
  Packer& operator=(const Packer&) = delete;

  /// Appends the packed block to `out`.
  void pack(ByteView block, Bytes& out);

 private:
  struct Contexts;
  Compression compression_;
  int level_;
  std::unique_ptr<Contexts> contexts_;
};

/// Unpacks one frame that holds `size` bytes. The result is shorter than `size` when the frame is cut
/// off or damaged: everything before that point is still there. Never more than `size` bytes.
Bytes unpack(Compression compression, ByteView packed, std::uint64_t size);

}  // namespace invar::recording
