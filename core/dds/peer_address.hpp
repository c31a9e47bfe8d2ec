// PeerAddress: where a participant receives, and whether anybody is still there.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/time.hpp"

namespace invar::dds {

struct PeerAddress {
  std::string host;  // IPv4, dotted
  std::uint16_t port = 0;
  bool operator==(const PeerAddress&) const = default;
};

/// Whether every one of these addresses is without a process: the host answers a datagram to such a port by ICMP "port
/// unreachable". A participant receives on ports of its own as long as it lives, so it is gone then, whatever its leases
/// say. False where no such answer comes within `patience`: silence proves nothing. Sends the header of an empty RTPS
/// message, which every implementation ignores. Any thread.
[[nodiscard]] bool are_abandoned(const std::vector<PeerAddress>& addresses,
                                 Duration patience = Duration::milliseconds(2));

}  // namespace invar::dds
