#include "tools/host/own_host.hpp"

#include <linux/rtnetlink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/clock.hpp"
#include "core/base/name.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/own_address.hpp"

namespace invar::tools {

InputError unknown_host(const config::Cell& cell, const std::string& host) {
  std::vector<std::string> names;
  for (const auto& each : cell.hosts) names.push_back(each.name);
  return {"--host", "`" + printable(host) + "` is no host of " + cell.file.string(),
          config::mend_name(host, names)};
}

std::set<std::string> own_hosts(const config::Cell& cell, const std::string& host) {
  if (!host.empty()) {
    if (std::any_of(cell.hosts.begin(), cell.hosts.end(),
                    [&](const auto& each) { return each.name == host; }))
      return {host};
    throw unknown_host(cell, host);
  }
  std::set<std::string> own;
  std::string list;
  for (const auto& each : cell.hosts) {
    if (dds::is_own_address(each.address)) own.insert(each.name);
    list +=
        (list.empty() ? "" : ", ") + each.name + " " + (each.address.empty() ? each.interface : each.address);
  }
  if (own.empty())
    throw InputError{
        cell.file.string() + ": hosts",
        "this PC is none of them (" + list + "); it has " + dds::own_addresses_text(),
        "write its address into the file, or say with --host which one it becomes: `invar run` then "
        "works alone until the address comes"};
  return own;
}

std::string address_of(const config::CellHost& host) {
  return host.address.empty() ? dds::address_of_interface(host.interface) : host.address;
}

std::vector<dds::PeerHost> peers_of(const config::Cell& cell) {
  std::vector<dds::PeerHost> peers;
  for (const auto& host : cell.hosts) {
    if (host.address.empty()) continue;  // it calls the others
    const auto processes = static_cast<std::size_t>(
        std::count_if(cell.processes.begin(), cell.processes.end(),
                      [&](const auto& process) { return process.host == host.name; }));
    const auto same = std::find_if(peers.begin(), peers.end(),
                                   [&](const auto& peer) { return peer.address == host.address; });
    if (same == peers.end())
      peers.push_back({host.address, processes});
    else
      same->processes += processes;
  }
  return peers;
}

std::optional<dds::ClockOptions> clocks_on(const config::Cell& cell, const std::string& host) {
  if (cell.hosts.size() < 2) return std::nullopt;
  dds::ClockOptions options{cell.id, host, {}};
  for (const auto& each : cell.hosts) options.hosts.push_back(each.name);
  return options;
}

dds::NodeOptions node_on(const config::Cell& cell, const std::string& process, const std::string& host) {
  dds::NodeOptions options;
  options.cell = cell.name;
  options.process = process;
  options.domain = static_cast<std::uint32_t>(cell.domain);
  options.shared_memory = cell.shared_memory;
  for (const auto& each : cell.hosts)
    if (each.name == host) options.addresses = {address_of(each)};
  options.may_come_later = true;
  options.peers = peers_of(cell);
  if (cell.security) options.identity = dds::Identity{{cell.security->keys}, process, false};
  return options;
}

bool wait_for_address(const config::Cell& cell, const std::string& host, const std::atomic<bool>& stop) {
  const auto found =
      std::find_if(cell.hosts.begin(), cell.hosts.end(), [&](const auto& each) { return each.name == host; });
  const auto is_there = [&] {
    const std::string address = address_of(*found);
    return !address.empty() && dds::has_address(address);
  };
  if (found == cell.hosts.end() || is_there()) return true;
  const std::string what =
      cell.file.string() + ": hosts." + host + ": no running interface of this PC " +
      (found->address.empty() ? "is `" + found->interface + "` with an address" : "has " + found->address) +
      "; it has " + dds::own_addresses_text();
  constexpr Duration for_interface = Duration::seconds(60.0);
  if (!cell.address_wait && !found->address.empty()) {
    spdlog::warn("{}; this host works alone until the address is there", what);
    return true;
  }
  const Duration patience = cell.address_wait.value_or(for_interface);
  const Instant end = monotonic_now() + patience;
  spdlog::warn("{}; waiting {:g} s for it (`address_wait`)", what, patience.in_seconds());
  while (!stop) {
    if (is_there()) {
      spdlog::warn("{} is there", address_of(*found));
      return true;
    }
    if (monotonic_now() >= end)
      throw std::runtime_error{
          what +
          "; look for the cable and the network's settings, mend the address in the file, "
          "or leave `address_wait` out: then the host works alone until the address comes"};
    std::this_thread::sleep_for(std::chrono::milliseconds{100});
  }
  return false;
}

AddressWatch::AddressWatch(std::string address)
    : address_{std::move(address)},
      netlink_{socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE)},
      is_there_{dds::has_address(address_)},
      was_there_{is_there_} {
  sockaddr_nl groups{};
  groups.nl_family = AF_NETLINK;
  groups.nl_groups = RTMGRP_LINK | RTMGRP_IPV4_IFADDR;
  if (netlink_ >= 0 && bind(netlink_, reinterpret_cast<const sockaddr*>(&groups), sizeof groups) != 0) {
    close(netlink_);
    netlink_ = -1;  // then once a second must do
  }
}

AddressWatch::~AddressWatch() {
  if (netlink_ >= 0) close(netlink_);
}

/// What it was does not matter: a change of a link or an address.
bool AddressWatch::kernel_told() const {
  std::array<char, 4096> message{};
  bool told = false;
  while (netlink_ >= 0 && recv(netlink_, message.data(), message.size(), 0) > 0) told = true;
  return told;
}

std::optional<AddressWatch::News> AddressWatch::look() {
  const Instant now = monotonic_now();
  if (!kernel_told() && now - looked_ < Duration::seconds(1.0)) return std::nullopt;
  looked_ = now;
  const bool is_there = dds::has_address(address_);
  if (is_there == is_there_) return std::nullopt;
  is_there_ = is_there;
  if (is_there && !std::exchange(was_there_, true))
    return News{true, address_ + " is there: this process joins the other PCs"};
  if (is_there) return News{true, address_ + " is back: this process hears other PCs again"};
  return News{false,
              "no running interface of this PC has " + address_ + " any more" +
                  (++gone_ == 1 ? "" : ", " + std::to_string(gone_) + " times by now") + " (it has " +
                  dds::own_addresses_text() +
                  "): other PCs do not hear this process; look for the cable and the network's settings"};
}

}  // namespace invar::tools
