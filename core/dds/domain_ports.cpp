#include "core/dds/domain_ports.hpp"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>

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

std::set<std::uint32_t> ports_in_memory() {
  constexpr std::string_view begin = "/dev/shm/fastrtps_port";
  std::set<std::uint32_t> ports;
  std::error_code error;
  for (const auto& process : std::filesystem::directory_iterator{"/proc", error}) {
    if (std::isdigit(static_cast<unsigned char>(process.path().filename().string().front())) == 0) continue;
    std::ifstream maps{process.path() / "maps"};
    for (std::string line; std::getline(maps, line);) {
      const auto at = line.find(begin);
      if (at == std::string::npos) continue;
      const char* digits = line.data() + at + begin.size();
      std::uint32_t port = 0;
      if (std::from_chars(digits, line.data() + line.size(), port).ec == std::errc{}) ports.insert(port);
    }
  }
  return ports;
}

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
  static const std::set<std::uint32_t> in_memory = ports_in_memory();
  enum class Avoid { bound, left, held };  // each what is before it, too
  const auto is_taken = [](std::uint32_t port, Avoid avoid) {
    return is_bound(port) || (avoid != Avoid::bound && has_memory(port)) ||
           (avoid == Avoid::held && in_memory.contains(port));
  };
  const auto find = [&](std::int32_t below, Avoid avoid) {
    for (std::int32_t tried = 0; tried < below; ++tried) {
      const std::int32_t number = (first + tried) % below;
      if (!is_taken(ports.discovery(number), avoid) && !is_taken(ports.data(number), avoid)) return number;
    }
    return -1;
  };
  for (const auto& [below, avoid] :
       {std::pair{std::min(window, numbers), Avoid::held}, std::pair{numbers, Avoid::held},
        std::pair{numbers, Avoid::left}, std::pair{numbers, Avoid::bound}})
    if (const std::int32_t number = find(below, avoid); number >= 0) return number;
  throw InputError{"domain " + std::to_string(domain),
                   numbers == 0 ? "has no ports below 65536"
                                : "all " + std::to_string(numbers) + " participants of this PC are taken",
                   "choose a domain from 0 to 232 in which fewer programs run"};
}

}  // namespace invar::dds
