// A Modbus TCP connection and the devices behind it, kept alive through faults.
//
// A process has one bus for each host and port (`shared_bus`): many gateways take one connection, and serve several units on it.
//
// Two ways to drive it, chosen once:
// - `start()`: one I/O thread polls every device at its map's period, sends writes as they come and the
//   heartbeat while its owner refreshes it. Time is CLOCK_MONOTONIC. For wall-clock cells.
// - `exchange(now)`: the caller's thread does one round - heartbeat if due, queued writes, all reads - and
//   returns when it is done. Time is what the caller says. For simulated time (with a
//   generous `answer_timeout`): with a simulated device that
//   swaps its image in its own step (server.hpp), every step sees the same values in every run.
//
// Reconnecting: a failed connection and a silent device are each left alone for `first_retry`, then twice as long, up to
// `longest_retry`. A silent unit behind a gateway does not hold up
// its neighbours. link.hpp says which failures close the connection.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/backoff.hpp"
#include "core/modbus/device.hpp"
#include "core/modbus/link.hpp"

namespace invar::modbus {

struct BusOptions {
  std::string host = "127.0.0.1";  // name or address, IPv4 or IPv6
  std::uint16_t port = 502;
  Duration connect_timeout = Duration::milliseconds(500);
  Duration first_retry = Duration::milliseconds(100);
  Duration longest_retry = Duration::milliseconds(5000);
  /// Instead of the maps' answer timeouts. Waits are real even where time is simulated: there say some seconds,
  /// so that a busy host is not taken for a dead device.
  std::optional<Duration> answer_timeout = {};
};

class Bus {
 public:
  explicit Bus(BusOptions options);
  ~Bus();  // stops
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// A device on this bus; lives as long as the bus, or until it is removed. Waits for a round that is under way.
  Device& add(RegisterMap map);
  /// Sends the queued writes of the device if the connection stands, then forgets it. Precondition: it is of this bus.
  void remove(Device& device);

  /// Starts the I/O thread. Precondition: `exchange` was never called.
  void start();
  [[nodiscard]] bool is_started() const { return thread_.joinable(); }
  /// Sends what is still queued if the connection stands, then ends the thread; waits at most about one
  /// answer timeout a device. The heartbeat stops with it.
  void stop();

  /// One round with every device that is not backing off. True when every request of every device was
  /// answered without exception. Blocks at most for the timeouts. Precondition: not started, `now` never goes
  /// back. `only`: with this device alone.
  bool exchange(Instant now, const Device* only = nullptr);
  /// Only the due heartbeats and the queued writes, no reads: what was computed from this step's readings
  /// arrives in this step.
  bool send(Instant now, const Device* only = nullptr);

  [[nodiscard]] bool is_connected() const { return connected_.load(); }
  [[nodiscard]] LinkCounters counters() const;

 private:
  enum class Part { writes_only, all, due };
  bool round(Instant now, Part part, const Device* only = nullptr);
  Outcome connect(Instant now);
  void set_polled(Instant now, const Device* only);
  void run();
  Instant work();
  void wait_until(Instant when) const;

  BusOptions options_;
  std::mutex io_mutex_;  // guards link and devices; held for a round
  Link link_;
  Backoff link_backoff_;
  Failure unconnected_{Cause::unreachable};  // why there was no connection the last time
  std::vector<std::unique_ptr<Device>> devices_;
  std::vector<std::unique_ptr<DeviceIo>> ios_;
  std::size_t first_ = 0;  // the device that a round begins with
  int wake_ = -1;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> connected_{false};
  bool polled_ = false;
  std::thread thread_;
  mutable std::mutex counters_mutex_;
  LinkCounters counters_;
};

/// The bus of this process to that host and port, made and, unless the caller steps it, started if there is none yet. Any
/// thread. Precondition: all callers of a process step it, or none does.
[[nodiscard]] std::shared_ptr<Bus> shared_bus(const BusOptions& options, bool stepped);

}  // namespace invar::modbus
