#include "core/dds/domain_ports.hpp"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>

#include "core/base/fault.hpp"

namespace invar::dds {

namespace {

constexpr std::int32_t most_participants = 110;
constexpr std::uint32_t last_port = 65'535;

bool is_bound(std::uint32_t port) {
  const int end = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (end < 0) return false;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool bound =
      bind(end, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 && errno == EADDRINUSE;
  close(end);
  return bound;
}

/// Used in shared memory, or left behind there.
bool has_memory(std::uint32_t port) {
  std::error_code error;
  return std::filesystem::exists("/dev/shm/fastrtps_port" + std::to_string(port), error);
}

}  // namespace

std::int32_t DomainPorts::participants() const {
  if (discovery(0) + 1 > last_port) return 0;
  return std::min(most_participants, static_cast<std::int32_t>((last_port - discovery(0) + 1) / 2));
}

std::string DomainPorts::text() const {
  return std::to_string(multicast()) + ", " + std::to_string(discovery(0)) + "-" + std::to_string(last());
}

std::int32_t called_numbers(std::uint32_t domain, std::size_t processes) {
  constexpr std::int32_t each = 4, beside = 12;
  const auto most = static_cast<std::size_t>(DomainPorts{domain}.participants());
  return static_cast<std::int32_t>(std::min(most, each * processes + beside));
}

std::int32_t free_participant_number(std::uint32_t domain, std::int32_t window) {
  static std::atomic<std::int32_t> made{0};
  const DomainPorts ports{domain};
  const std::int32_t numbers = ports.participants();
  const std::int32_t first = getpid() % most_participants * 4 + made++;
  const auto is_taken = [](std::uint32_t port, bool memory_counts) {
    return is_bound(port) || (memory_counts && has_memory(port));
  };
  const auto find = [&](std::int32_t below, bool memory_counts) {
    for (std::int32_t tried = 0; tried < below; ++tried) {
      const std::int32_t number = (first + tried) % below;
      if (!is_taken(ports.discovery(number), memory_counts) && !is_taken(ports.data(number), memory_counts))
        return number;
    }
    return -1;
  };
  for (const std::int32_t below : {std::min(window, numbers), numbers})
    for (const bool memory_counts : {true, false})
      if (const std::int32_t number = find(below, memory_counts); number >= 0) return number;
  throw InputError{"domain " + std::to_string(domain),
                   numbers == 0 ? "has no ports below 65536"
                                : "all " + std::to_string(numbers) + " participants of this PC are taken",
                   "choose a domain from 0 to 232 in which fewer programs run"};
}

}  // namespace invar::dds
