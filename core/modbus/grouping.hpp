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

/// The reads that bring every readable register once. A 32-bit value is never split over two requests (it
/// could tear), and none asks for more than the map's `max_registers` and `max_bits`. Where the map says `gaps: readable`, a request runs across unnamed addresses when that saves
/// a request: a round trip costs more than the 250 bytes it could carry. Otherwise it holds named ones only.
/// Set-up only; O(n^2).
[[nodiscard]] std::vector<ReadRequest> plan_reads(const RegisterMap& map);

/// The request in two parts, at its widest gap or else near its middle, no value split; itself where it cannot be parted.
[[nodiscard]] std::vector<ReadRequest> parted(const RegisterMap& map, const ReadRequest& request);

}  // namespace invar::modbus
