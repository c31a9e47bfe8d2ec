// PromisedAddress: addresses of this PC on which the middleware works before they are there, and again when they come back.
#pragma once

#include <string>
#include <vector>

namespace invar::dds {

struct OwnAddress {
  std::string address;    // dotted
  std::string interface;  // "eth0"
};

/// Fast DDS 2.9 reads the addresses of a PC once, and makes no socket on one that is missing: a process that started without its
/// cable is deaf for ever. So the calls of the C library that Fast DDS makes are ours (as in shared_memory_calls.hpp).
/// Our getifaddrs shows a promised address, and bind takes it before it is there (IP_FREEBIND). Multicast groups that the kernel
/// refuses until then are kept for `renew_promises`. Any thread.
void promise_address(const std::string& address);
/// After a promised address came or came back: joins the multicast groups on it.
void renew_promises();
/// The addresses that are there in fact, without those that are only promised.
[[nodiscard]] std::vector<OwnAddress> addresses_without_promises(bool running_only);
/// Whether the program's calls reach these functions; false would leave a process deaf that starts without its cable.
[[nodiscard]] bool address_calls_are_ours();

}  // namespace invar::dds
