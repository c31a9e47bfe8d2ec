#include "tools/cell/service_manager.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace invar::tools {

namespace {

/// The value of a variable, which goes out of the environment.
std::string taken(const char* name) {
  const char* value = std::getenv(name);
  const std::string text = value != nullptr ? value : "";
  unsetenv(name);
  return text;
}

/// A path, or with a `@` in front a name that is no file. Nothing where it does not fit.
std::optional<std::pair<sockaddr_un, socklen_t>> address_of(const std::string& name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.size() < 2 || name.size() >= sizeof address.sun_path || (name[0] != '/' && name[0] != '@'))
    return {};
  std::copy(name.begin(), name.end(), address.sun_path);
  if (name[0] == '@') address.sun_path[0] = '\0';
  // A path ends with its zero; the length of the other kind is that of the name.
  const std::size_t length = offsetof(sockaddr_un, sun_path) + name.size() + (name[0] == '/' ? 1 : 0);
  return std::pair{address, static_cast<socklen_t>(length)};
}

}  // namespace

ServiceManager ServiceManager::from_environment() {
  ServiceManager manager;
  manager.socket_ = taken("NOTIFY_SOCKET");
  const std::string pid = taken("WATCHDOG_PID"), usec = taken("WATCHDOG_USEC");
  if (!pid.empty() && pid != std::to_string(getpid())) return manager;  // somebody else is watched
  manager.watchdog_ = 1e-6 * std::strtod(usec.c_str(), nullptr);
  if (!(manager.watchdog_ > 0.0 && manager.watchdog_ < 1e9)) manager.watchdog_ = 0.0;
  return manager;
}

void ServiceManager::say(const std::string& lines) const noexcept {
  if (socket_.empty()) return;
  const auto address = address_of(socket_);
  const int socket = address ? ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0) : -1;
  if (socket < 0) return;
  (void)sendto(socket, lines.data(), lines.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
               reinterpret_cast<const sockaddr*>(&address->first), address->second);
  close(socket);
}

void ServiceManager::status(const std::string& line) {
  if (line == status_) return;
  status_ = line;
  say("STATUS=" + line);
}

void ServiceManager::feed(std::uint64_t cycles) {
  if (watchdog_ <= 0.0 || cycles_ == cycles) return;
  const Clock::time_point now = Clock::now();
  if (cycles_ && std::chrono::duration<double>(now - fed_).count() < watchdog_ / 8.0) return;
  cycles_ = cycles;
  fed_ = now;
  say("WATCHDOG=1");
}

ServiceSocket::ServiceSocket(const std::filesystem::path& file) {
  const auto address = address_of(file.string());
  socket_ = address ? ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0) : -1;
  const int on = 1;
  if (socket_ < 0 ||
      bind(socket_, reinterpret_cast<const sockaddr*>(&address->first), address->second) != 0 ||
      setsockopt(socket_, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) != 0) {
    const std::string why = address ? std::strerror(errno) : "its path is too long";
    if (socket_ >= 0) close(socket_);
    throw std::runtime_error{"the socket " + file.string() +
                             ", by which processes say that they work: " + why};
  }
}

ServiceSocket::~ServiceSocket() { close(socket_); }

std::optional<ServiceSocket::Message> ServiceSocket::take() const {
  std::array<char, 4096> text{};
  iovec part{text.data(), text.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = recvmsg(socket_, &message, MSG_CMSG_CLOEXEC);
  if (size < 0) return std::nullopt;
  Message taken{0, {text.data(), static_cast<std::size_t>(size)}};
  if (const cmsghdr* head = CMSG_FIRSTHDR(&message);
      head != nullptr && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_CREDENTIALS) {
    ucred sender{};
    std::memcpy(&sender, CMSG_DATA(head), sizeof sender);
    taken.pid = sender.pid;
  }
  return taken;
}

bool has_line(const std::string& lines, const std::string& line) {
  return ("\n" + lines + "\n").find("\n" + line + "\n") != std::string::npos;
}

}  // namespace invar::tools
