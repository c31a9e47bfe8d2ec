#include "core/recording/compression.hpp"

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <limits>

#include "core/base/contract.hpp"

namespace invar::recording {

std::string_view name_of(Compression compression) {
  switch (compression) {
    case Compression::none:
      return "";
    case Compression::lz4:
      return "lz4";
    case Compression::zstd:
      return "zstd";
  }
  return "";
}

std::optional<Compression> compression_named(std::string_view name) {
  for (const auto each : {Compression::none, Compression::lz4, Compression::zstd})
    if (name == name_of(each)) return each;
  return std::nullopt;
}

std::uint32_t crc32_of(ByteView bytes, std::uint32_t so_far) {
  return static_cast<std::uint32_t>(crc32_z(so_far, bytes.data(), bytes.size()));
}

struct Packer::Contexts {
  std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> zstd{nullptr, ZSTD_freeCCtx};
};

Packer::Packer(Compression compression, int level)
    : compression_{compression}, level_{level}, contexts_{std::make_unique<Contexts>()} {
  if (compression_ != Compression::zstd) return;
  contexts_->zstd.reset(ZSTD_createCCtx());
  INVAR_EXPECTS(contexts_->zstd != nullptr);
}

Packer::~Packer() = default;

void Packer::pack(ByteView block, Bytes& out) {
  const std::size_t before = out.size();
  std::size_t packed = 0;
  switch (compression_) {
    case Compression::none:
      put(out, block);
      return;
    case Compression::lz4:
      out.resize(before + LZ4F_compressFrameBound(block.size(), nullptr));
      packed =
          LZ4F_compressFrame(out.data() + before, out.size() - before, block.data(), block.size(), nullptr);
      INVAR_EXPECTS(LZ4F_isError(packed) == 0, LZ4F_getErrorName(packed));
      break;
    case Compression::zstd:
      out.resize(before + ZSTD_compressBound(block.size()));
      packed = ZSTD_compressCCtx(contexts_->zstd.get(), out.data() + before, out.size() - before,
                                 block.data(), block.size(), level_);
      INVAR_EXPECTS(ZSTD_isError(packed) == 0, ZSTD_getErrorName(packed));
      break;
  }
  out.resize(before + packed);
}

namespace {

/// Grows `out` in steps, so that a damaged size field cannot make us ask for all the memory there is.
std::size_t make_room(Bytes& out, std::size_t used, std::uint64_t size) {
  constexpr std::size_t step = 1U << 20U;
  const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(size - used, step));
  out.resize(used + wanted);
  return wanted;
}

Bytes unpack_zstd(ByteView packed, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DStream, std::size_t (*)(ZSTD_DStream*)> stream{ZSTD_createDStream(),
                                                                             ZSTD_freeDStream};
  INVAR_EXPECTS(stream != nullptr);
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  Bytes out;
  std::size_t used = 0;
  while (used < size) {
    ZSTD_outBuffer piece{nullptr, make_room(out, used, size), 0};
    piece.dst = out.data() + used;
    const std::size_t status = ZSTD_decompressStream(stream.get(), &piece, &in);
    used += piece.pos;
    if (ZSTD_isError(status) != 0 || status == 0 || piece.pos == 0) break;
  }
  out.resize(used);
  return out;
}

Bytes unpack_lz4(ByteView packed, std::uint64_t size) {
  LZ4F_dctx* raw = nullptr;
  INVAR_EXPECTS(LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)) == 0);
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> context{raw,
                                                                             LZ4F_freeDecompressionContext};
  Bytes out;
  std::size_t used = 0;
  while (used < size) {
    std::size_t produced = make_room(out, used, size);
    std::size_t consumed = packed.size();
    const std::size_t status =
        LZ4F_decompress(context.get(), out.data() + used, &produced, packed.data(), &consumed, nullptr);
    if (LZ4F_isError(status) != 0) break;
    used += produced;
    packed = packed.subspan(consumed);
    if (status == 0 || (produced == 0 && consumed == 0)) break;
  }
  out.resize(used);
  return out;
}

}  // namespace

Bytes unpack(Compression compression, ByteView packed, std::uint64_t size) {
  switch (compression) {
    case Compression::none: {
      const auto kept = packed.first(static_cast<std::size_t>(std::min<std::uint64_t>(size, packed.size())));
      return {kept.begin(), kept.end()};
    }
    case Compression::lz4:
      return unpack_lz4(packed, size);
    case Compression::zstd:
      return unpack_zstd(packed, size);
  }
  return {};
}

}  // namespace invar::recording
