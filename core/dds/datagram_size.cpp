#include "core/dds/datagram_size.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace invar::dds {

namespace {

constexpr std::uint32_t ethernet_mtu = 1500;

std::uint32_t mtu_of(const char* interface) {
  ifreq request{};
  std::strncpy(request.ifr_name, interface, sizeof request.ifr_name - 1);
  const int any = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool known = any >= 0 && ioctl(any, SIOCGIFMTU, &request) == 0 && request.ifr_mtu > 0;
  if (any >= 0) close(any);
  return known ? static_cast<std::uint32_t>(request.ifr_mtu) : ethernet_mtu;
}

std::string address_text(const sockaddr& address) {
  sockaddr_in internet{};
  std::memcpy(&internet, &address, sizeof internet);
  std::array<char, INET_ADDRSTRLEN> text{};
  return inet_ntop(AF_INET, &internet.sin_addr, text.data(), text.size()) == nullptr ? "" : text.data();
}

}  // namespace

std::uint32_t largest_datagram(std::uint32_t mtu) {
  constexpr std::uint32_t headers = 28;      // IPv4 and UDP
  constexpr std::uint32_t every_host = 576;  // what RFC 791 asks each host to take
  constexpr std::uint32_t most = 65'500;     // of Fast DDS
  return std::min(std::max(mtu, every_host) - headers, most);
}

std::uint32_t largest_datagram(const std::vector<std::string>& addresses) {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return largest_datagram(ethernet_mtu);
  std::uint32_t loopback = 0;
  std::uint32_t network = 0;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET ||
        (entry->ifa_flags & IFF_UP) == 0)
      continue;
    const std::string address = address_text(*entry->ifa_addr);
    if (!addresses.empty() && std::find(addresses.begin(), addresses.end(), address) == addresses.end())
      continue;
    std::uint32_t& smallest = (entry->ifa_flags & IFF_LOOPBACK) != 0 ? loopback : network;
    const std::uint32_t mtu = mtu_of(entry->ifa_name);
    smallest = smallest == 0 ? mtu : std::min(smallest, mtu);
  }
  freeifaddrs(list);
  if (network != 0) return largest_datagram(network);
  return largest_datagram(loopback != 0 ? loopback : ethernet_mtu);
}

}  // namespace invar::dds
