// Which reads to send: the fewest requests that cover a map, and among those the fewest words.
#pragma once

#include <cstdint>
#include <vector>

#include "core/modbus/map.hpp"

namespace invar::modbus {

/// One read request and the registers (indexes into the map) that its answer holds.
struct ReadRequest {
  Kind kind = Kind::holding;
  std::uint16_t address = 0;
  std::uint16_t count = 0;
  std::vector<std::size_t> registers;
};

/// What one request may ask for (Modbus application protocol V1.1b3, 6.1 and 6.3).
inline constexpr unsigned largest_word_read = 125;
inline constexpr unsigned largest_bit_read = 2000;

/// The reads that bring every readable register once. A 32-bit value is never split over two requests (it
/// could tear). Where the map says `gaps: readable`, a request runs across unnamed addresses when that saves
/// a request: a round trip costs more than the 250 bytes it could carry. Otherwise it holds named ones only.
/// Set-up only; O(n^2).
[[nodiscard]] std::vector<ReadRequest> plan_reads(const RegisterMap& map);

}  // namespace invar::modbus
