// OwnHost: which hosts of a cell this PC is, and whether their address is there.
#pragma once

#include <atomic>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/time.hpp"
#include "core/config/cell.hpp"
#include "core/dds/node.hpp"

namespace invar::tools {

/// The hosts whose processes this PC runs: `host` where it is given, otherwise all that have an address of this PC.
/// Throws InputError when `host` is none of the cell, or this PC has none of the addresses.
[[nodiscard]] std::set<std::string> own_hosts(const config::Cell& cell, const std::string& host);

/// Why `--host` names none of the cell's hosts, with the nearest of them.
[[nodiscard]] InputError unknown_host(const config::Cell& cell, const std::string& host);

/// The address of a host: that of the file, or the one that its interface has on this PC now; empty: it has none.
[[nodiscard]] std::string address_of(const config::CellHost& host);

/// The hosts of the cell as a node calls them.
[[nodiscard]] std::vector<dds::PeerHost> peers_of(const config::Cell& cell);

/// How a process on `host` compares clocks with the others; nothing: the cell has one host.
[[nodiscard]] std::optional<dds::ClockOptions> clocks_on(const config::Cell& cell, const std::string& host);

/// How a program takes part in the cell as `process`, on a host of the file that this PC is. Its address may come later.
[[nodiscard]] dds::NodeOptions node_on(const config::Cell& cell, const std::string& process,
                                       const std::string& host);

/// Whether this PC has the address of a host. Where it does not, says that the host works alone until it comes; with an
/// `address_wait` in the file, and for an interface without an address, waits instead. Throws std::runtime_error at the end
/// of patience; the caller of the process may try again. False when `stop` came first.
bool wait_for_address(const config::Cell& cell, const std::string& host, const std::atomic<bool>& stop);

/// Whether an address stays, as the kernel tells (netlink). Not for the loop.
class AddressWatch {
 public:
  explicit AddressWatch(std::string address);
  ~AddressWatch();
  AddressWatch(const AddressWatch&) = delete;
  AddressWatch& operator=(const AddressWatch&) = delete;
  struct News {
    bool is_back = false;
    std::string text;
  };
  /// Says when the address went or came back. Looks where the kernel has told of a change, and once a second.
  [[nodiscard]] std::optional<News> look();

 private:
  [[nodiscard]] bool kernel_told() const;

  std::string address_;
  int netlink_;
  bool is_there_;
  bool was_there_;  // at any time
  int gone_ = 0;    // each time is news: the log must not take it for a repetition
  Instant looked_{INT64_MIN / 2};
};

}  // namespace invar::tools
