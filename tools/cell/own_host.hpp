// OwnHost: which hosts of a cell this PC is, and whether their address is there.
#pragma once

#include <atomic>
#include <optional>
#include <set>
#include <string>

#include "core/base/time.hpp"
#include "core/config/cell.hpp"

namespace invar::tools {

/// The hosts whose processes this PC runs: `host` where it is given, otherwise all that have an address of this PC.
/// Throws InputError when `host` is none of the cell, or this PC has none of the addresses.
[[nodiscard]] std::set<std::string> own_hosts(const config::Cell& cell, const std::string& host);

/// Waits until this PC has the address of a host, as long as the file's `address_wait`, and says so. Throws
/// std::runtime_error at the end of patience: whoever started the process may try again. False when `stop` came first.
bool wait_for_address(const config::Cell& cell, const std::string& host, const std::atomic<bool>& stop);

/// Whether an address stays. Not for the loop.
class AddressWatch {
 public:
  explicit AddressWatch(std::string address) : address_{std::move(address)} {}
  struct News {
    bool is_back = false;
    std::string text;
  };
  /// Looks once a second at most; says when the address went or came back.
  [[nodiscard]] std::optional<News> look();

 private:
  std::string address_;
  bool is_there_ = true;
  int gone_ = 0;  // each time is news: the log must not take it for a repetition
  Instant looked_{INT64_MIN / 2};
};

}  // namespace invar::tools
