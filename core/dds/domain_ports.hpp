// DomainPorts: the UDP ports of a DDS domain, and the number of a participant from which its ports follow.
#pragma once

#include <cstdint>
#include <string>

namespace invar::dds {

/// The formula of the RTPS specification (section 9.6.2.4) with its default constants. A domain has one port for multicast
/// discovery, and each of its participants on a PC two: one for discovery, one for data.
struct DomainPorts {
  std::uint32_t domain = 0;

  [[nodiscard]] std::uint32_t multicast() const { return 7400 + 250 * domain; }
  [[nodiscard]] std::uint32_t discovery(std::int32_t number) const {
    return multicast() + 10 + 2 * static_cast<std::uint32_t>(number);
  }
  [[nodiscard]] std::uint32_t data(std::int32_t number) const { return discovery(number) + 1; }
  /// Discovery, handshakes and keys come by even ports, data by odd ones. The contents do not tell: they may be encrypted.
  [[nodiscard]] static constexpr bool is_of_discovery(std::uint32_t port) { return port % 2 == 0; }
  /// Participants of one PC that a domain has room for: 110, or as many as fit below port 65536 (63 in domain 232).
  [[nodiscard]] std::int32_t participants() const;
  [[nodiscard]] std::uint32_t last() const { return data(participants() - 1); }
  /// For a firewall: "7400, 7410-7629".
  [[nodiscard]] std::string text() const;
};

/// Ports follow from this number. By default Fast DDS takes the lowest free one, so that a killed and restarted process has
/// its earlier ports. It has the shared memory of the dead one with them, which others first give up (port_memory.hpp).
/// A number that left no trace on this PC comes first. Nobody on this network uses its ports: a container may share the
/// network and not the memory. Where another process takes it in the same moment, the library shifts the ports. Throws
/// InputError when all are taken. A free number below `window` comes before all others: others call those without multicast.
/// Set-up only.
[[nodiscard]] std::int32_t free_participant_number(std::uint32_t domain, std::int32_t window = 0);

/// How many participant numbers are called on a PC with so many processes of the cell. A process has two participants, or
/// three with a recorder. The rest is for the launcher and for numbers that killed processes still hold.
[[nodiscard]] std::int32_t called_numbers(std::uint32_t domain, std::size_t processes);

}  // namespace invar::dds
