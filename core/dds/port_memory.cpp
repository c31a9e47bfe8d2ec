#include "core/dds/port_memory.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <charconv>
#include <cstddef>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace invar::dds {

namespace {

constexpr std::string_view port_prefix = "/fastrtps_port";

/// Which file a name meant: device and number.
using FileNumber = std::pair<dev_t, ino_t>;

/// A descriptor of each, by which its memory is reached also after Fast DDS has closed it.
using Files = std::map<FileNumber, int>;

struct Opened {
  std::mutex mutex;
  std::map<std::uint32_t, Files> ports;
};

/// Never destroyed: Fast DDS opens and closes while the program ends.
Opened& opened() {
  static auto* all = new Opened;
  return *all;
}

std::optional<std::uint32_t> port_of(std::string_view name) {
  if (!name.starts_with(port_prefix)) return std::nullopt;
  const std::string_view digits = name.substr(port_prefix.size());
  std::uint32_t port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
  return port;
}

FileNumber number_of(const struct stat& status) { return {status.st_dev, status.st_ino}; }

/// The state of a port in its memory: PortNode in SharedMemGlobal.hpp of Fast DDS 2.9.
struct PortState {
  std::uint32_t port, listeners, check_ms, wait_ms, capacity, waiting;
  std::uint32_t flags;  // good, opened by one reader, opened for reading
};
constexpr std::uint32_t good = 1U, all_flags = 7U;

/// Where the flags lie. The manager of Boost lays the state out; its members tell it apart.
std::optional<off_t> place_of_flags(const std::vector<char>& memory, std::uint32_t port) {
  for (std::size_t at = 0; at + sizeof(PortState) <= memory.size(); at += sizeof(std::uint32_t)) {
    PortState state;
    std::memcpy(&state, memory.data() + at, sizeof state);
    if (state.port == port && state.check_ms > 0 && state.wait_ms == state.check_ms / 3 &&
        state.capacity > 0 && (state.flags & ~all_flags) == 0)
      return static_cast<off_t>(at + offsetof(PortState, flags));
  }
  return std::nullopt;
}

/// The next writer that wants to use it finds it so.
void mark_as_not_good(int file, std::uint32_t port) {
  struct stat status {};
  if (fstat(file, &status) != 0 || status.st_size <= 0) return;
  std::vector<char> memory(static_cast<std::size_t>(status.st_size));
  const ssize_t read = pread(file, memory.data(), memory.size(), 0);
  memory.resize(read > 0 ? static_cast<std::size_t>(read) : 0);
  const auto place = place_of_flags(memory, port);
  if (!place) return;
  std::uint32_t flags = 0;
  std::memcpy(&flags, memory.data() + *place, sizeof flags);
  flags &= ~good;
  (void)!pwrite(file, &flags, sizeof flags, *place);
}

}  // namespace

void note_opened_port(std::string_view name, int file) {
  const auto port = port_of(name);
  struct stat status {};
  if (!port || fstat(file, &status) != 0) return;
  Opened& all = opened();
  const std::lock_guard lock{all.mutex};
  const auto [place, is_new] = all.ports[*port].try_emplace(number_of(status), -1);
  if (is_new) place->second = fcntl(file, F_DUPFD_CLOEXEC, 0);
}

void give_up_replaced_port(std::uint32_t port) {
  Opened& all = opened();
  const std::lock_guard lock{all.mutex};
  const auto found = all.ports.find(port);
  if (found == all.ports.end()) return;
  struct stat status {};
  if (stat(("/dev/shm" + std::string{port_prefix} + std::to_string(port)).c_str(), &status) != 0) return;
  std::erase_if(found->second, [&](const auto& file) {
    if (file.first == number_of(status)) return false;
    if (file.second >= 0) {
      mark_as_not_good(file.second, port);
      close(file.second);
    }
    return true;
  });
}

}  // namespace invar::dds
