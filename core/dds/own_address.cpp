#include "core/dds/own_address.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <algorithm>

namespace invar::dds {

std::vector<OwnAddress> own_addresses() {
  std::vector<OwnAddress> out;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return out;
  constexpr unsigned runs = IFF_UP | IFF_RUNNING;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET ||
        (entry->ifa_flags & runs) != runs)
      continue;
    char text[INET_ADDRSTRLEN] = "";
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr, text, sizeof text);
    out.push_back({text, entry->ifa_name});
  }
  freeifaddrs(list);
  return out;
}

bool has_address(const std::string& address) {
  const auto all = own_addresses();
  return std::any_of(all.begin(), all.end(), [&](const auto& own) { return own.address == address; });
}

std::string own_addresses_text() {
  std::string text;
  for (const auto& own : own_addresses())
    text += (text.empty() ? "" : ", ") + own.address + " (" + own.interface + ")";
  return text.empty() ? "none" : text;
}

}  // namespace invar::dds
