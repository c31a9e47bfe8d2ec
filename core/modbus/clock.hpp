// CLOCK_MONOTONIC as an Instant.
#pragma once

#include <ctime>

#include "core/base/time.hpp"

namespace invar::modbus {

inline Instant monotonic_now() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return {std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec};
}

}  // namespace invar::modbus
