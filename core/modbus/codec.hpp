// How a value stands in registers: types, word orders and scales, both ways.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/modbus/map.hpp"

namespace invar::modbus {

/// A value as it stands on the wire: `width()` words, or one 0/1 for coils and discrete inputs.
struct Words {
  std::array<std::uint16_t, 2> word{};
  friend bool operator==(const Words&, const Words&) = default;
};

/// The value in SI that `words` (at least `width()` of them) stand for. Real-time.
[[nodiscard]] double decode(const Encoding& how, std::span<const std::uint16_t> words);

/// The nearest representation of `value` in SI, clamped to what the type holds; a boolean is set by anything
/// but 0. A boolean inside a word gives the word with only its own bit. Precondition: `value` is no NaN
/// unless the type is float32. Real-time. Worked: 30.1 in uint16 with scale 0.01 is 3010; 1.5f in cdab is
/// 0x0000 0x3FC0.
[[nodiscard]] Words encode(const Encoding& how, double value);

/// The smallest and largest value in SI that the type can hold.
[[nodiscard]] Range representable(const Encoding& how);

}  // namespace invar::modbus
