#include "core/dds/promised_address.hpp"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>

namespace invar::dds {

namespace {

constexpr unsigned runs = IFF_UP | IFF_RUNNING;

/// An entry of ours at the head of the list of the C library.
struct Entry {
  ifaddrs head{};
  sockaddr_in address{}, mask{};
  char name[IFNAMSIZ] = "promised";
};

/// A call about multicast on a promised address.
struct Kept {
  int file = -1;
  ino_t socket = 0;  // tells a socket from a later one of the same number
  int option = 0;
  std::array<char, sizeof(ip_mreqn)> value{};
  socklen_t size = 0;
};

struct Promises {
  std::mutex mutex;
  std::vector<in_addr> addresses;
  std::vector<Kept> kept;
  std::vector<const ifaddrs*> lists;  // heads that are ours
  std::atomic<bool> any{false};
};

Promises& promises() {
  static auto& all = *new Promises;  // never destroyed: the middleware's threads may outlive statics
  return all;
}

bool same(in_addr one, in_addr other) { return one.s_addr == other.s_addr; }

bool is_promised(in_addr address) {
  Promises& all = promises();
  if (!all.any.load(std::memory_order_acquire)) return false;
  const std::lock_guard lock{all.mutex};
  return std::any_of(all.addresses.begin(), all.addresses.end(),
                     [&](in_addr each) { return same(each, address); });
}

in_addr address_of(const ifaddrs& entry) {
  return reinterpret_cast<const sockaddr_in*>(entry.ifa_addr)->sin_addr;
}

bool is_ipv4(const ifaddrs& entry) {
  return entry.ifa_addr != nullptr && entry.ifa_addr->sa_family == AF_INET;
}

int library_getifaddrs(ifaddrs** list) {
  static const auto call = reinterpret_cast<int (*)(ifaddrs**)>(dlsym(RTLD_NEXT, "getifaddrs"));
  return call(list);
}

void library_freeifaddrs(ifaddrs* list) {
  static const auto call = reinterpret_cast<void (*)(ifaddrs*)>(dlsym(RTLD_NEXT, "freeifaddrs"));
  call(list);
}

long system_setsockopt(int file, int level, int option, const void* value, socklen_t size) {
  return syscall(SYS_setsockopt, file, level, option, value, size);
}

ino_t socket_number(int file) {
  struct stat status {};
  return fstat(file, &status) == 0 ? status.st_ino : 0;
}

/// The interface's address in a call about multicast.
in_addr interface_of(int option, const void* value, socklen_t size) {
  in_addr address{};
  if (option == IP_ADD_MEMBERSHIP && size >= sizeof(ip_mreq))
    address = static_cast<const ip_mreq*>(value)->imr_interface;
  else if (option == IP_MULTICAST_IF && size >= sizeof(ip_mreqn))
    address = static_cast<const ip_mreqn*>(value)->imr_address;
  else if (option == IP_MULTICAST_IF && size == sizeof(in_addr))
    std::memcpy(&address, value, sizeof address);
  return address;
}

/// Whether the call is one about a promised address; it is then kept.
bool keep(int file, int option, const void* value, socklen_t size) {
  if (value == nullptr || size > sizeof(Kept::value) || !is_promised(interface_of(option, value, size)))
    return false;
  Kept one{file, socket_number(file), option, {}, size};
  std::memcpy(one.value.data(), value, size);
  Promises& all = promises();
  const std::lock_guard lock{all.mutex};
  std::erase_if(all.kept, [](const Kept& each) { return socket_number(each.file) != each.socket; });
  all.kept.push_back(one);
  return true;
}

}  // namespace

void promise_address(const std::string& address) {
  in_addr number{};
  if (inet_pton(AF_INET, address.c_str(), &number) != 1 || is_promised(number)) return;
  Promises& all = promises();
  const std::lock_guard lock{all.mutex};
  all.addresses.push_back(number);
  all.any.store(true, std::memory_order_release);
}

void renew_promises() {
  Promises& all = promises();
  const std::lock_guard lock{all.mutex};
  std::erase_if(all.kept, [](const Kept& each) { return socket_number(each.file) != each.socket; });
  // A group that was joined already is refused as such, and stays joined.
  for (const Kept& each : all.kept)
    (void)system_setsockopt(each.file, IPPROTO_IP, each.option, each.value.data(), each.size);
}

std::vector<OwnAddress> addresses_without_promises(bool running_only) {
  std::vector<OwnAddress> out;
  ifaddrs* list = nullptr;
  if (library_getifaddrs(&list) != 0) return out;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (!is_ipv4(*entry) || (running_only && (entry->ifa_flags & runs) != runs)) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const in_addr address = address_of(*entry);
    inet_ntop(AF_INET, &address, text.data(), text.size());
    out.push_back({text.data(), entry->ifa_name});
  }
  library_freeifaddrs(list);
  return out;
}

}  // namespace invar::dds

extern "C" {

int getifaddrs(ifaddrs** list) noexcept {
  using namespace invar::dds;
  const int result = library_getifaddrs(list);
  Promises& all = promises();
  if (result != 0 || !all.any.load(std::memory_order_acquire)) return result;
  const std::lock_guard lock{all.mutex};
  for (const in_addr address : all.addresses) {
    bool is_there = false;
    for (const ifaddrs* entry = *list; entry != nullptr; entry = entry->ifa_next)
      is_there = is_there ||
                 (is_ipv4(*entry) && (entry->ifa_flags & runs) == runs && same(address_of(*entry), address));
    if (is_there) continue;
    auto* ours = new (std::nothrow) Entry;
    if (ours == nullptr) break;
    ours->address.sin_family = ours->mask.sin_family = AF_INET;
    ours->address.sin_addr = address;
    ours->mask.sin_addr.s_addr = INADDR_NONE;
    ours->head.ifa_next = *list;
    ours->head.ifa_name = ours->name;
    ours->head.ifa_flags = runs | IFF_MULTICAST;
    ours->head.ifa_addr = reinterpret_cast<sockaddr*>(&ours->address);
    ours->head.ifa_netmask = reinterpret_cast<sockaddr*>(&ours->mask);
    all.lists.push_back(&ours->head);
    *list = &ours->head;
  }
  return result;
}

void freeifaddrs(ifaddrs* list) noexcept {
  using namespace invar::dds;
  Promises& all = promises();
  const std::lock_guard lock{all.mutex};
  while (list != nullptr) {
    const auto ours = std::find(all.lists.begin(), all.lists.end(), list);
    if (ours == all.lists.end()) return library_freeifaddrs(list);
    all.lists.erase(ours);
    ifaddrs* next = list->ifa_next;
    delete reinterpret_cast<Entry*>(list);  // its first member
    list = next;
  }
}

int bind(int file, const sockaddr* address, socklen_t size) noexcept {
  using namespace invar::dds;
  if (address != nullptr && size >= sizeof(sockaddr_in) && address->sa_family == AF_INET &&
      is_promised(reinterpret_cast<const sockaddr_in*>(address)->sin_addr)) {
    const int yes = 1;
    (void)system_setsockopt(file, IPPROTO_IP, IP_FREEBIND, &yes, sizeof yes);
  }
  return static_cast<int>(syscall(SYS_bind, file, address, size));
}

int setsockopt(int file, int level, int option, const void* value, socklen_t size) noexcept {
  using namespace invar::dds;
  const auto result = static_cast<int>(system_setsockopt(file, level, option, value, size));
  if (level != IPPROTO_IP || (option != IP_ADD_MEMBERSHIP && option != IP_MULTICAST_IF)) return result;
  const int refused = errno;
  const bool kept = keep(file, option, value, size);
  if (result != 0 && kept && (refused == EADDRNOTAVAIL || refused == ENODEV)) return 0;
  errno = refused;
  return result;
}

}  // extern "C"

namespace invar::dds {

bool address_calls_are_ours() {
  const auto is_ours = [](const char* name, void* ours) { return dlsym(RTLD_DEFAULT, name) == ours; };
  return is_ours("getifaddrs", reinterpret_cast<void*>(&::getifaddrs)) &&
         is_ours("bind", reinterpret_cast<void*>(&::bind)) &&
         is_ours("setsockopt", reinterpret_cast<void*>(&::setsockopt));
}

}  // namespace invar::dds
