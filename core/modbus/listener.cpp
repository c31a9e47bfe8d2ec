#include "core/modbus/listener.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

#include "core/base/clock.hpp"
#include "core/base/fault.hpp"

namespace invar::modbus {

namespace {

constexpr std::size_t most_masters = 64;

void allow_reuse(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

/// A bound socket that does not listen yet; -1 and errno where that cannot be.
int bound_socket(const sockaddr* address, socklen_t size) {
  const int socket = ::socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return -1;
  allow_reuse(socket);
  if (::bind(socket, address, size) == 0) return socket;
  const int error = errno;
  ::close(socket);
  errno = error;
  return -1;
}

/// The length of the first request in `bytes`, 0 while it is incomplete, -1 when it can be none.
ssize_t request_length(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 6) return 0;
  const int protocol = bytes[2] << 8 | bytes[3];
  const int length = bytes[4] << 8 | bytes[5];
  if (protocol != 0 || length < 2 || length > 254) return -1;
  return bytes.size() < static_cast<std::size_t>(6 + length) ? 0 : 6 + length;
}

}  // namespace

Listener::Listener(const std::string& host, std::uint16_t port, Handler handler,
                   std::function<void()> on_connection)
    : handler_{std::move(handler)}, on_connection_{std::move(on_connection)} {
  const std::string where = "modbus server " + host + ":" + std::to_string(port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
    throw InputError{where, gai_strerror(error), "name an address of this host"};
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> address{found, &freeaddrinfo};
  socket_ = bound_socket(address->ai_addr, address->ai_addrlen);
  if (socket_ < 0 || ::listen(socket_, 16) != 0) {
    const std::string error = std::strerror(errno);
    if (socket_ >= 0) ::close(socket_);
    throw InputError{where, error, "choose another port, or 0 for a free one"};
  }
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  getsockname(socket_, reinterpret_cast<sockaddr*>(&bound), &size);
  port_ = ntohs(bound.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(&bound)->sin6_port
                                            : reinterpret_cast<sockaddr_in*>(&bound)->sin_port);
  wake_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  thread_ = std::thread{[this] { run(); }};
}

Listener::~Listener() {
  {
    const std::lock_guard lock{mutex_};
    stopping_ = true;
  }
  wake();
  thread_.join();
  for (const auto& master : masters_) ::close(master.socket);
  if (socket_ >= 0) ::close(socket_);
  ::close(wake_);
}

void Listener::wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto ignored = ::write(wake_, &one, sizeof one);
}

void Listener::refuse(bool refusing) {
  std::unique_lock lock{mutex_};
  refuse_ = refusing;
  wake();
  applied_.wait(lock, [&] { return refusing_ == refuse_ || stopping_; });
}

void Listener::apply_refusal() {
  const std::lock_guard lock{mutex_};
  if (refuse_ == refusing_) return;
  if (refuse_) {
    for (const auto& master : masters_) ::close(master.socket);
    masters_.clear();
    // A bound socket that does not listen keeps the port and answers connections with a reset.
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    getsockname(socket_, reinterpret_cast<sockaddr*>(&bound), &size);
    ::close(socket_);
    socket_ = bound_socket(reinterpret_cast<sockaddr*>(&bound), size);
  } else if (socket_ >= 0) {
    ::listen(socket_, 16);
  }
  refusing_ = refuse_;
  applied_.notify_all();
}

void Listener::run() {
  std::vector<pollfd> watched;
  for (;;) {
    apply_refusal();
    {
      const std::lock_guard lock{mutex_};
      if (stopping_) return;
    }
    watched.clear();
    watched.push_back({wake_, POLLIN, 0});
    // A bound socket that does not listen would report a hang-up for ever; poll ignores negative numbers.
    watched.push_back({refusing_ ? -1 : socket_, POLLIN, 0});
    Instant earliest{INT64_MAX};
    for (const auto& master : masters_) {
      watched.push_back({master.socket, static_cast<short>(master.has_answer ? 0 : POLLIN), 0});
      if (master.has_answer) earliest = std::min(earliest, master.answer_at);
    }
    int timeout_ms = -1;
    if (earliest.ns != INT64_MAX)
      timeout_ms =
          static_cast<int>(std::max<std::int64_t>(0, (earliest - monotonic_now()).ns / 1'000'000 + 1));
    if (::poll(watched.data(), watched.size(), timeout_ms) < 0) continue;

    if ((watched[0].revents & POLLIN) != 0) {
      std::uint64_t count = 0;
      [[maybe_unused]] const auto ignored = ::read(wake_, &count, sizeof count);
    }
    const Instant now = monotonic_now();
    for (std::size_t i = 0; i < masters_.size(); ++i) {
      if (watched[i + 2].revents != 0) receive(masters_[i]);
      serve(masters_[i], now);
    }
    std::erase_if(masters_, [](const Master& master) { return master.socket < 0; });
    if ((watched[1].revents & POLLIN) != 0) accept_one();
  }
}

void Listener::accept_one() {
  const int socket = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket < 0) return;
  if (masters_.size() >= most_masters) {
    ::close(socket);
    return;
  }
  const int yes = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  masters_.emplace_back();
  masters_.back().socket = socket;
  on_connection_();
}

void Listener::receive(Master& master) {
  std::array<std::uint8_t, 1024> bytes;
  const ssize_t size = ::recv(master.socket, bytes.data(), bytes.size(), 0);
  if (size > 0) {
    master.received.insert(master.received.end(), bytes.begin(), bytes.begin() + size);
  } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {
    ::close(master.socket);
    master.socket = -1;
  }
}

void Listener::serve(Master& master, Instant now) {
  while (master.socket >= 0) {
    if (master.has_answer) {
      if (now < master.answer_at) return;
      send_answer(master);
      continue;
    }
    const ssize_t length = request_length(master.received);
    if (length == 0) return;
    if (length < 0) {
      ::close(master.socket);
      master.socket = -1;
      return;
    }
    master.answer = handler_({master.received.data(), static_cast<std::size_t>(length)});
    master.received.erase(master.received.begin(), master.received.begin() + length);
    master.answer_at = now + master.answer.delay;
    master.has_answer = true;
  }
}

void Listener::send_answer(Master& master) {
  const Verdict& answer = master.answer;
  master.has_answer = false;
  bool sent = true;
  if (answer.size > 0) {
    const ssize_t size = ::send(master.socket, answer.reply.data(), answer.size, MSG_NOSIGNAL);
    sent = size == static_cast<ssize_t>(answer.size);  // a master that does not read its answers is let go
  }
  if (sent && !answer.close) return;
  ::close(master.socket);
  master.socket = -1;
}

}  // namespace invar::modbus
