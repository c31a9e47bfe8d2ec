// Talk of a process with the service manager that started it; `invar run` hears its own processes in the same words.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace invar::tools {

/// The protocol of sd_notify(3): datagrams of lines `NAME=value` to the socket that NOTIFY_SOCKET names. Without that variable
/// nothing is sent. Any failure is left alone: a service manager that does not listen stops no cell. Not real-time.
class ServiceManager {
 public:
  /// Takes NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID out of the environment, so that no child speaks in this process's name.
  /// Before any thread.
  static ServiceManager from_environment();

  [[nodiscard]] bool is_there() const { return !socket_.empty(); }
  /// Silence after which the manager ends the process [s]; 0: it does not watch.
  [[nodiscard]] double watchdog() const { return watchdog_; }

  void say(const std::string& lines) const noexcept;
  void ready() const noexcept { say("READY=1"); }
  void stopping() const noexcept { say("STOPPING=1"); }
  /// One line for people; sent where it changed.
  void status(const std::string& line);
  /// `cycles`: a counter of the loop that is watched. The watchdog is fed where the counter moved, eight times within `watchdog()`
  /// at most. So a loop that hangs starves it, though the thread that asks here lives on.
  void feed(std::uint64_t cycles);

 private:
  using Clock = std::chrono::steady_clock;
  std::string socket_;
  double watchdog_ = 0.0;
  std::string status_;
  std::optional<std::uint64_t> cycles_;
  Clock::time_point fed_{};
};

/// The other end: a socket in a folder of ours.
class ServiceSocket {
 public:
  /// Throws std::runtime_error where none can be made.
  explicit ServiceSocket(const std::filesystem::path& file);
  ~ServiceSocket();
  ServiceSocket(const ServiceSocket&) = delete;
  ServiceSocket& operator=(const ServiceSocket&) = delete;

  struct Message {
    pid_t pid = 0;  // of the sender, by the kernel
    std::string lines;
  };
  /// The next one, without waiting.
  [[nodiscard]] std::optional<Message> take() const;

 private:
  int socket_ = -1;
};

/// Whether a message has this line.
[[nodiscard]] bool has_line(const std::string& lines, const std::string& line);

}  // namespace invar::tools
