// The sockets and the thread of a simulated device: accepts masters, cuts their bytes into requests, sends
// answers.
#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/image.hpp"

namespace invar::modbus {

/// The answer to a request.
struct Verdict {
  Image::Reply reply{};
  std::size_t size = 0;  // of the reply; 0: none is sent
  Duration delay;
  bool close = false;  // the connection, after whatever is sent
};

class Listener {
 public:
  using Handler = std::function<Verdict(std::span<const std::uint8_t> request)>;

  /// Listens at host and port (0: a free one) from now on. Throws InputError when that cannot be.
  Listener(const std::string& host, std::uint16_t port, Handler handler, std::function<void()> on_connection);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// While refusing, all connections are closed and new ones refused; the port stays ours. Returns when that
  /// is so.
  void refuse(bool refusing);

 private:
  struct Master {
    int socket = -1;
    std::vector<std::uint8_t> received;
    Verdict answer;  // held back while delayed
    Instant answer_at;
    bool has_answer = false;
  };

  void run();
  void apply_refusal();
  void accept_one();
  void receive(Master& master);
  void serve(Master& master, Instant now);
  void send_answer(Master& master);
  void wake() const;

  Handler handler_;
  std::function<void()> on_connection_;
  int socket_ = -1;
  int wake_ = -1;
  std::uint16_t port_ = 0;
  std::vector<Master> masters_;  // the thread's own

  std::mutex mutex_;
  std::condition_variable applied_;
  bool stopping_ = false;
  bool refuse_ = false;    // wanted
  bool refusing_ = false;  // is so
  std::thread thread_;
};

}  // namespace invar::modbus
