#include "core/modbus/read_back.hpp"

#include <cmath>

#include "core/modbus/codec.hpp"

namespace invar::modbus {

bool shows(const Register& reg, double wanted, const Register& by, double shown) {
  const Words words = encode(reg, wanted);
  const double arrived = decode(reg, words.word);
  if (&reg == &by) return shown == arrived;
  const auto half_count = [](const Register& r) {
    return r.type == Type::float32 ? 0.0 : 0.5 * std::abs(r.scale);
  };
  return std::abs(shown - arrived) <= half_count(reg) + half_count(by) + 1e-6 * std::abs(arrived);
}

}  // namespace invar::modbus
