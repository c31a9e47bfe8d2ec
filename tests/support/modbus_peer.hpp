// A Modbus TCP device that says on each request exactly the bytes that a test wants, when it wants.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <thread>
#include <vector>

namespace invar::test {

using Bytes = std::vector<std::uint8_t>;

/// One request, and what is done about it.
class Talk {
 public:
  Talk(int socket, int of_connection, int in_connection, Bytes bytes)
      : request{std::move(bytes)}, connection{of_connection}, number{in_connection}, socket_{socket} {}

  void send(const Bytes& bytes) const { (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// Byte by byte.
  void trickle(const Bytes& bytes, int pause_ms) const {
    for (const std::uint8_t byte : bytes) {
      std::this_thread::sleep_for(std::chrono::milliseconds{pause_ms});
      send({byte});
    }
  }
  static void wait(int milliseconds) { std::this_thread::sleep_for(std::chrono::milliseconds{milliseconds}); }
  void close() { closed_ = true; }
  /// By RST, which also throws away what was not read.
  void reset() {
    const linger now{1, 0};
    setsockopt(socket_, SOL_SOCKET, SO_LINGER, &now, sizeof now);
    closed_ = true;
  }
  [[nodiscard]] bool is_closed() const { return closed_; }

  [[nodiscard]] unsigned word(std::size_t at) const { return (unsigned{request[at]} << 8) | request[at + 1]; }
  [[nodiscard]] int function() const { return request[7]; }
  [[nodiscard]] unsigned address() const { return word(8); }
  [[nodiscard]] unsigned count() const { return word(10); }
  /// A sound answer: every register shows its address plus 1000, every bit whether its address is odd; writes are echoed.
  [[nodiscard]] Bytes honest() const {
    Bytes pdu{request[7]};
    if (function() > 4) {
      pdu.insert(pdu.end(), request.begin() + 8, request.begin() + 12);
    } else if (function() > 2) {
      pdu.push_back(static_cast<std::uint8_t>(2 * count()));
      for (unsigned i = 0; i < count(); ++i) {
        const unsigned value = address() + i + 1000;
        pdu.push_back(static_cast<std::uint8_t>(value >> 8));
        pdu.push_back(static_cast<std::uint8_t>(value));
      }
    } else {
      pdu.push_back(static_cast<std::uint8_t>((count() + 7) / 8));
      Bytes bits((count() + 7) / 8);
      for (unsigned i = 0; i < count(); ++i)
        if ((address() + i) % 2 == 1) bits[i / 8] = static_cast<std::uint8_t>(bits[i / 8] | 1U << (i % 8));
      pdu.insert(pdu.end(), bits.begin(), bits.end());
    }
    return framed(pdu);
  }
  [[nodiscard]] Bytes exception(int code) const {
    return framed({static_cast<std::uint8_t>(request[7] | 0x80), static_cast<std::uint8_t>(code)});
  }
  [[nodiscard]] Bytes framed(const Bytes& pdu) const {
    const std::size_t length = pdu.size() + 1;
    Bytes frame{request[0],
                request[1],
                0,
                0,
                static_cast<std::uint8_t>(length >> 8),
                static_cast<std::uint8_t>(length),
                request[6]};
    frame.insert(frame.end(), pdu.begin(), pdu.end());
    return frame;
  }

  Bytes request;
  int connection = 0;  // counted from 1
  int number = 0;      // of the request in its connection, from 1

 private:
  int socket_;
  bool closed_ = false;
};

/// Serves one connection after the other, so that a second one waits for the first.
class ModbusPeer {
 public:
  using Answer = std::function<void(Talk&)>;
  /// `at`: a port that is free; 0: any.
  explicit ModbusPeer(Answer answer, std::uint16_t at = 0) : answer_{std::move(answer)} {
    listening_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(at);
    socklen_t size = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    const int again = 1;  // a port that was in use a moment ago
    (void)::setsockopt(listening_, SOL_SOCKET, SO_REUSEADDR, &again, sizeof again);
    if (::bind(listening_, generic, size) != 0 || ::listen(listening_, 16) != 0 ||
        ::getsockname(listening_, generic, &size) != 0)
      throw std::runtime_error{"no peer"};
    port = ntohs(address.sin_port);
    thread_ = std::thread{[this] { serve(); }};
  }
  ~ModbusPeer() {
    stopping_ = true;
    thread_.join();
    ::close(listening_);
  }
  ModbusPeer(const ModbusPeer&) = delete;
  ModbusPeer& operator=(const ModbusPeer&) = delete;

  std::uint16_t port = 0;
  std::atomic<int> connections{0};
  std::atomic<int> requests{0};
  std::atomic<int> writes{0};
  std::atomic<int> idle_ms{0};  // closes a connection that is idle for so long; 0: never

 private:
  bool wait_for(int socket, int most_ms) const {
    for (int waited = 0; !stopping_ && (most_ms == 0 || waited < most_ms); waited += 5) {
      pollfd watched{socket, POLLIN, 0};
      if (::poll(&watched, 1, 5) > 0) return true;
    }
    return false;
  }
  void serve() {
    while (wait_for(listening_, 0)) {
      const int socket = ::accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC);
      ++connections;
      Bytes received;
      for (int number = 1; wait_for(socket, idle_ms);) {
        std::uint8_t bytes[300];
        const ssize_t size = ::recv(socket, bytes, sizeof bytes, 0);
        if (size <= 0) break;
        received.insert(received.end(), bytes, bytes + size);
        bool closed = false;
        while (!closed && received.size() >= 6 && received.size() >= 6U + received[5]) {
          const auto end = received.begin() + 6 + received[5];
          Talk talk{socket, connections, number++, Bytes{received.begin(), end}};
          received.erase(received.begin(), end);
          ++requests;
          if (talk.function() > 4) ++writes;
          answer_(talk);
          closed = talk.is_closed();
        }
        if (closed) break;
      }
      ::close(socket);
    }
  }

  Answer answer_;
  int listening_ = -1;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::test
