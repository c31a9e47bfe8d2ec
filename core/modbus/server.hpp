// A simulated Modbus TCP device: serves the registers of a map and behaves as the map says.
//
//   Server heater{load_map("maps/heater.yaml"), {.port = 0}};   // 0 picks a free one: heater.port()
//   each step of the device:
//     const double power = heater.value("power");               // what the masters wrote up to the last
//     exchange
//     ...integrate...
//     heater.set("slide_temperature", temperature);             // SI, temperatures in degC
//     heater.exchange(now);                                     // the step's values become visible, all at
//     once
//
// A thread answers any number of masters, but what they see of the device changes only in `exchange`, and the
// device sees their writes only from the next `exchange` on. So a simulated cell that steps device and master
// in turn gives the same values in every run, and a real-time one never sees half a step. A master's own
// writes are read back at once, by it and by others.
//
// The map's watchdog runs in the device's own clock, the `now` of `exchange`. Before the first heartbeat, and
// when none has come for `timeout`, the comm-loss action of the map is in force (again at every exchange) and
// its flag set. Only a changed heartbeat counts. A register that both sides write keeps the later write.
//
// Not for real-time loops: `exchange` takes a lock that the answering thread holds while it builds an answer.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/fault_script.hpp"
#include "core/modbus/image.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {

class Listener;
struct Verdict;

struct ServerOptions {
  std::string host = "127.0.0.1";  // IPv4 or IPv6 address, or a name
  std::uint16_t port = 0;          // 0: a free one
  FaultScript faults = {};
};

struct ServerCounters {
  std::uint64_t connections = 0;
  std::uint64_t requests = 0;    // all that came
  std::uint64_t writes = 0;      // writes that were carried out
  std::uint64_t exceptions = 0;  // requests answered with an exception
};

class Server {
 public:
  /// Listens from now on. Throws InputError when the address cannot be bound.
  Server(RegisterMap map, ServerOptions options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] const RegisterMap& map() const { return map_; }
  /// The register's index, to spare the look-up by name. Precondition: it exists.
  [[nodiscard]] std::size_t index(std::string_view name) const;

  // The device's side: one thread.
  /// The register as of the last exchange, in SI. A value that the device itself `set` shows after the next exchange.
  [[nodiscard]] double value(std::size_t reg) const;
  [[nodiscard]] double value(std::string_view name) const { return value(index(name)); }
  /// A master wrote it between the last two exchanges.
  [[nodiscard]] bool was_written(std::size_t reg) const;
  [[nodiscard]] bool was_written(std::string_view name) const { return was_written(index(name)); }
  /// Will be visible from the next exchange on, in the register's resolution and clamped to its type.
  void set(std::size_t reg, double value);
  void set(std::string_view name, double value) { set(index(name), value); }
  /// Swaps both sides, runs the watchdog and the fault script. Precondition: `now` never goes back.
  void exchange(Instant now);
  /// The comm-loss action is in force; false where the map has no heartbeat.
  [[nodiscard]] bool comm_lost() const { return lost_; }

  [[nodiscard]] ServerCounters counters() const;

 private:
  /// The answer to one request under the faults in force. Called by the listener's thread.
  Verdict handle(std::span<const std::uint8_t> request);
  void watch(Instant now);
  [[nodiscard]] bool is_frozen(std::size_t reg) const;

  const RegisterMap map_;
  const FaultScript faults_;

  // The device's side; its thread only.
  std::vector<double> values_;
  std::vector<bool> was_written_;
  std::vector<std::optional<double>> pending_;
  bool lost_ = false;
  bool refusing_ = false;
  bool started_ = false;
  Instant start_;
  Instant last_beat_;

  mutable std::mutex mutex_;  // guards all below
  Image image_;
  std::vector<std::size_t> written_;  // by masters since the last exchange
  std::vector<ScriptedFault> active_;
  ServerCounters counters_;

  std::unique_ptr<Listener> listener_;
};

}  // namespace invar::modbus
