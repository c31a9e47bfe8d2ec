// A DDS domain and a loopback-only node for one test program.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "core/dds/node.hpp"

namespace invar::dds::testing {

/// Programs that run at the same time get different domains: each claims one by a socket that goes with the process. Ports
/// of domains up to 100 stay below those that the system gives to others.
inline std::uint32_t claim_domain() {
  const auto first = static_cast<std::uint32_t>(getpid());
  for (std::uint32_t i = 0; i < 100; ++i) {
    const std::uint32_t domain = 1U + (first + i) % 100U;
    const std::string name = "invar-test-domain/" + std::to_string(domain);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::copy(name.begin(), name.end(), address.sun_path + 1);
    const int claim = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (bind(claim, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return domain;
    close(claim);
  }
  return 1U + first % 100U;
}

/// The domain of this program.
inline std::uint32_t test_domain() {
  static const std::uint32_t claimed = claim_domain();
  return claimed;
}

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
