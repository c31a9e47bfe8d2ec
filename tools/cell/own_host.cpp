#include "tools/cell/own_host.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/dds/own_address.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

std::set<std::string> own_hosts(const config::Cell& cell, const std::string& host) {
  std::vector<std::string> names;
  for (const auto& each : cell.hosts) names.push_back(each.name);
  if (!host.empty()) {
    if (std::find(names.begin(), names.end(), host) != names.end()) return {host};
    throw InputError{"--host", "`" + host + "` is no host of " + cell.file.string(), mend_name(host, names)};
  }
  std::set<std::string> own;
  std::string list;
  for (const auto& each : cell.hosts) {
    if (dds::has_address(each.address)) own.insert(each.name);
    list += (list.empty() ? "" : ", ") + each.name + " " + each.address;
  }
  if (own.empty())
    throw InputError{
        cell.file.string() + ": hosts",
        "this PC is none of them (" + list + "); it has " + dds::own_addresses_text(),
        "write its address into the file, or say with --host which one it becomes: `invar run` then "
        "waits for the address"};
  return own;
}

bool wait_for_address(const config::Cell& cell, const std::string& host, const std::atomic<bool>& stop) {
  const auto found =
      std::find_if(cell.hosts.begin(), cell.hosts.end(), [&](const auto& each) { return each.name == host; });
  if (found == cell.hosts.end() || dds::has_address(found->address)) return true;
  const std::string what = cell.file.string() + ": hosts." + host + ": no running interface of this PC has " +
                           found->address + "; it has " + dds::own_addresses_text();
  const Instant end = monotonic_now() + cell.address_wait;
  spdlog::warn("{}; waiting {:g} s for it (`address_wait`)", what, cell.address_wait.in_seconds());
  while (!stop) {
    if (dds::has_address(found->address)) {
      spdlog::warn("{} is there", found->address);
      return true;
    }
    if (monotonic_now() >= end)
      throw std::runtime_error{
          what +
          "; look for the cable and the network's settings, mend the address in the file, "
          "or wait longer with `address_wait`"};
    std::this_thread::sleep_for(std::chrono::milliseconds{100});
  }
  return false;
}

std::optional<AddressWatch::News> AddressWatch::look() {
  const Instant now = monotonic_now();
  if (now - looked_ < Duration::seconds(1.0)) return std::nullopt;
  looked_ = now;
  const bool is_there = dds::has_address(address_);
  if (is_there == is_there_) return std::nullopt;
  is_there_ = is_there;
  if (is_there) return News{true, address_ + " is back: this process hears other PCs again"};
  return News{false,
              "no running interface of this PC has " + address_ + " any more" +
                  (++gone_ == 1 ? "" : ", " + std::to_string(gone_) + " times by now") + " (it has " +
                  dds::own_addresses_text() +
                  "): other PCs do not hear this process; look for the cable and the network's settings"};
}

}  // namespace invar::tools
