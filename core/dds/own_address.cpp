#include "core/dds/own_address.hpp"

#include <algorithm>

#include "core/dds/promised_address.hpp"

namespace invar::dds {

std::vector<OwnAddress> own_addresses() { return addresses_without_promises(true); }

namespace {
bool has(const std::vector<OwnAddress>& all, const std::string& address) {
  return std::any_of(all.begin(), all.end(), [&](const auto& own) { return own.address == address; });
}
}  // namespace

bool has_address(const std::string& address) { return has(own_addresses(), address); }

bool is_own_address(const std::string& address) { return has(addresses_without_promises(false), address); }

std::string address_of_interface(const std::string& interface) {
  for (const auto& own : own_addresses())
    if (own.interface == interface) return own.address;
  return {};
}

std::string own_addresses_text() {
  std::string text;
  for (const auto& own : own_addresses())
    text += (text.empty() ? "" : ", ") + own.address + " (" + own.interface + ")";
  return text.empty() ? "none" : text;
}

}  // namespace invar::dds
