// DatagramSize: how large a message may be so that IP need not cut it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace invar::dds {

/// Largest datagram of UDP over IPv4 [bytes] on the interfaces that carry `addresses` (empty: on all that are up). A larger
/// datagram travels as IP fragments. Where one fragment is lost, the receiving kernel keeps the others for half a minute, and
/// soon takes none. Loopback counts only where it is alone: it carries 64 KiB whole.
[[nodiscard]] std::uint32_t largest_datagram(const std::vector<std::string>& addresses);

/// The same for an interface of this MTU [bytes].
[[nodiscard]] std::uint32_t largest_datagram(std::uint32_t mtu);

}  // namespace invar::dds
