// HolderId: the holder of a certificate, as each message of a secured participant names it and as a list of the revoked does.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/dds/rtps_message.hpp"

namespace invar::dds {

/// The first six octets of the GUID of a secured participant: a bit that is set, then 47 bits of the SHA-256 of the subject's name of
/// its certificate (DDS Security 1.1, 9.3.3). The handshake proves them.
using HolderId = std::uint64_t;

[[nodiscard]] inline HolderId holder_of(const GuidPrefix& prefix) noexcept {
  HolderId id = 0;
  for (std::size_t i = 0; i < 6; ++i) id = id << 8U | std::to_integer<HolderId>(prefix[i]);
  return id;
}

/// `hash`: the SHA-256 of a subject's name.
[[nodiscard]] inline HolderId holder_of_hash(std::span<const unsigned char> hash) noexcept {
  HolderId first = 0;
  for (std::size_t i = 0; i < 6; ++i) first = first << 8U | hash[i];
  return (HolderId{1} << 47U) | first >> 1U;
}

/// The serial number of the certificate with this hash: a list of the revoked has numbers alone, and so each tells the holder.
/// Seventeen octets: a mark, which makes it positive, and the first 16 of the hash.
inline constexpr unsigned char serial_mark = 0x49;
inline constexpr std::size_t serial_size = 17;
[[nodiscard]] inline std::vector<unsigned char> serial_of(std::span<const unsigned char> hash) {
  std::vector<unsigned char> serial{serial_mark};
  serial.insert(serial.end(), hash.begin(), hash.begin() + (serial_size - 1));
  return serial;
}

}  // namespace invar::dds
