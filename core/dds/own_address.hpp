// OwnAddress: the IPv4 addresses that this PC has now, on interfaces that run.
#pragma once

#include <string>
#include <vector>

#include "core/dds/promised_address.hpp"

namespace invar::dds {

/// Those of interfaces that are up and have a carrier, which Fast DDS asks for too: on others it makes no socket.
[[nodiscard]] std::vector<OwnAddress> own_addresses();
[[nodiscard]] bool has_address(const std::string& address);
/// Also where its interface does not run, for instance without a cable.
[[nodiscard]] bool is_own_address(const std::string& address);
/// The first address of an interface by its name, such as eth0; empty: it has none, or does not run.
[[nodiscard]] std::string address_of_interface(const std::string& interface);
/// "127.0.0.1 (lo), 10.0.0.11 (eth0)"; "none".
[[nodiscard]] std::string own_addresses_text();

}  // namespace invar::dds
