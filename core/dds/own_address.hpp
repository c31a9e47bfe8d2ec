// OwnAddress: the IPv4 addresses that this PC has now, on interfaces that run.
#pragma once

#include <string>
#include <vector>

namespace invar::dds {

struct OwnAddress {
  std::string address;    // dotted
  std::string interface;  // "eth0"
};

/// Those of interfaces that are up and have a carrier, which Fast DDS asks for too: on others it makes no socket.
[[nodiscard]] std::vector<OwnAddress> own_addresses();
[[nodiscard]] bool has_address(const std::string& address);
/// "127.0.0.1 (lo), 10.0.0.11 (eth0)"; "none".
[[nodiscard]] std::string own_addresses_text();

}  // namespace invar::dds
