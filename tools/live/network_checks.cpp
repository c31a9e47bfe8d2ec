#include "tools/live/network_checks.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <fstream>

#include "core/dds/domain_ports.hpp"
#include "core/dds/memory_plan.hpp"
#include "core/dds/node.hpp"
#include "core/dds/own_address.hpp"

namespace invar::tools {

namespace {

using Level = Finding::Level;

std::string rule(const dds::DomainPorts& ports) {
  return "let UDP " + ports.text() + " in on each PC: nft insert rule inet filter input udp dport { " +
         ports.text() + " } accept";
}

/// A socket that closes itself.
class Socket {
 public:
  Socket() : file_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)} {}
  ~Socket() {
    if (file_ >= 0) close(file_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] int file() const { return file_; }
  template <class T>
  bool set(int level, int option, const T& value) const {
    return setsockopt(file_, level, option, &value, sizeof value) == 0;
  }

 private:
  int file_;
};

sockaddr_in end_of(in_addr address, std::uint32_t port) {
  sockaddr_in end{};
  end.sin_family = AF_INET;
  end.sin_addr = address;
  end.sin_port = htons(static_cast<std::uint16_t>(port));
  return end;
}

/// Whether a datagram to the discovery group leaves by this address and comes in again.
bool group_is_heard(const std::string& address, std::uint32_t port) {
  in_addr own{}, group{};
  inet_pton(AF_INET, address.c_str(), &own);
  inet_pton(AF_INET, "239.255.0.1", &group);
  const Socket in, out;
  const sockaddr_in to = end_of(group, port);
  // Bound to the group, as the cell's own sockets are, and beside them.
  if (!in.set(SOL_SOCKET, SO_REUSEADDR, 1) ||
      bind(in.file(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0 ||
      !in.set(IPPROTO_IP, IP_ADD_MEMBERSHIP, ip_mreq{group, own}) ||
      !out.set(IPPROTO_IP, IP_MULTICAST_IF, own))
    return false;
  const std::array<std::uint8_t, 20> header{'R', 'T', 'P', 'S', 2, 1};
  if (sendto(out.file(), header.data(), header.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to) <
      0)
    return false;
  sockaddr_in sent_by{};
  socklen_t size = sizeof sent_by;
  getsockname(out.file(), reinterpret_cast<sockaddr*>(&sent_by), &size);
  pollfd waiting{in.file(), POLLIN, 0};
  // Other messages of the cell come in here too.
  for (int i = 0; i < 100 && poll(&waiting, 1, 200) > 0; ++i) {
    std::array<std::uint8_t, 64> bytes{};
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    if (recvfrom(in.file(), bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &from_size) >
            0 &&
        from.sin_port == sent_by.sin_port)
      return true;
  }
  return false;
}

std::vector<Finding> addresses(const config::Cell& cell, const dds::DomainPorts& ports) {
  std::vector<Finding> findings;
  std::string list;
  for (const auto& host : cell.hosts) {
    list += (list.empty() ? "" : ", ") + host.name + " " + host.address;
    if (!dds::has_address(host.address)) continue;
    const std::string what = "host " + host.name;
    if (group_is_heard(host.address, ports.multicast()))
      findings.push_back({Level::good, what, host.address + " is here, discovery passes", ""});
    else
      findings.push_back({Level::bad, what,
                          host.address +
                              " is here, but a datagram to 239.255.0.1:" + std::to_string(ports.multicast()) +
                              " does not come back: nobody finds the cell",
                          rule(ports) + "; or the interface has multicast off"});
  }
  if (findings.empty())
    findings.push_back({Level::bad, "hosts",
                        "this PC is none of them (" + list + "); it has " + dds::own_addresses_text(),
                        "look for the cable and the network's settings, or mend the addresses in the file"});
  return findings;
}

Finding ports_of_the_domain(const dds::DomainPorts& ports) {
  const std::string what = "ports of domain " + std::to_string(ports.domain);
  std::ifstream file{"/proc/sys/net/ipv4/ip_local_port_range"};
  std::uint32_t low = 0, high = 0;
  file >> low >> high;
  const std::string state = "UDP " + ports.text() + " (discovery; two for each participant)";
  if (file && ports.last() >= low && ports.multicast() <= high)
    return {Level::note, what,
            state + ": the system gives ports from " + std::to_string(low) + " to " + std::to_string(high) +
                " to others too",
            "choose a domain up to 100, or raise net.ipv4.ip_local_port_range; " + rule(ports)};
  return {Level::good, what, state + "; with a firewall " + rule(ports), ""};
}

Finding memory(const config::Cell& cell) {
  if (!cell.shared_memory)
    return {Level::good, "shared memory of the cell", "not used (`shared_memory: false`)", ""};
  std::size_t here = 0;
  for (const auto& process : cell.processes)
    for (const auto& host : cell.hosts)
      here += process.host == host.name && dds::has_address(host.address) ? 1U : 0U;
  const auto plan = dds::plan_memory(dds::Traffic::general, dds::NodeOptions{}.segment_size, here);
  if (plan.shortage.empty())
    return {Level::good, "shared memory of the cell", "room for " + std::to_string(here) + " processes", ""};
  return {Level::note, "shared memory of the cell",
          "each of " + std::to_string(here) + " processes: " + plan.shortage, ""};
}

}  // namespace

std::vector<Finding> check_network(const config::Cell& cell) {
  const dds::DomainPorts ports{static_cast<std::uint32_t>(cell.domain)};
  auto findings = addresses(cell, ports);
  findings.push_back(ports_of_the_domain(ports));
  findings.push_back(memory(cell));
  return findings;
}

}  // namespace invar::tools
