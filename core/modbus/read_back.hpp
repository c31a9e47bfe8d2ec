// Whether a register shows what was written.
#pragma once

#include "core/modbus/map.hpp"

namespace invar::modbus {

/// Whether `shown` in register `by` is how `wanted` looks there once it was written to `reg`. SI.
[[nodiscard]] bool shows(const Register& reg, double wanted, const Register& by, double shown);

}  // namespace invar::modbus
