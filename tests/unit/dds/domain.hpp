// A DDS domain and a loopback-only node for one test program.
#pragma once

#include <unistd.h>

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "core/dds/node.hpp"

namespace invar::dds::testing {

/// Programs that run at the same time get different domains, as far as process ids differ. Ports of domains up to
/// 100 stay below those that the system gives to others.
inline std::uint32_t test_domain() { return 1U + static_cast<std::uint32_t>(getpid()) % 100U; }

inline NodeOptions local(const std::string& process) {
  NodeOptions options;
  options.cell = "test";
  options.process = process;
  options.domain = test_domain();
  options.addresses = {"127.0.0.1"};
  return options;
}

/// Waits until a fact holds; the bound is a watchdog against hanging, not a measurement.
inline bool eventually(const std::function<bool()>& fact, double patience = 20.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience);
  while (!fact()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  return true;
}

}  // namespace invar::dds::testing
