#include "core/physics/temperatures.hpp"

namespace invar::physics {

std::string_view temperature_of(const Term& term) {
  return term.info->plant == Plant::error_map && is_temperature(term.on) ? std::string_view{term.on}
                                                                         : "temperature";
}

bool is_temperature(std::string_view signal) {
  return signal == "temperature" || signal.starts_with("temperature_");
}

}  // namespace invar::physics
