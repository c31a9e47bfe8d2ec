// A device as its owner sees it: readings with their age, writes with their fate, and the sign of life.
//
//   Bus bus{{.host = "127.0.0.1", .port = 1502}};            // bus.hpp
//   Device& heater = bus.add(load_map("maps/heater.yaml"));
//   bus.start();                                             // or bus.exchange(now) once a step, see there
//   ...
//   heater.refresh();                                        // every cycle: "I live", or the heartbeat stops
//   const Reading slide = heater.value("slide_temperature");
//   if (slide.is_sound()) (void)heater.write("power", controller(slide.value));
//
// Values are in SI (temperatures in degC), booleans 0 or 1. Any thread may call; not for real-time loops
// (takes a short lock, never held over I/O). A name that the map does not have is a broken contract: look
// names that come from users up with `map().find` first.
//
// A write is sent once. It is repeated only where the device said that it has not carried it out. Then it was busy (exception
// 6), or has no function for one value (exception 1, then by function 15 or 16). When an answer is lost nobody knows
// whether the device did it: the write is `uncertain` until the read-back shows the value. The owner decides
// what to do then.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/modbus/link.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {

/// A value and how far to trust it.
struct Reading {
  double value = 0.0;  // SI; NaN before the first answer
  Duration age;        // since the answer arrived
  bool stale = true;   // older than the map allows, or never read
  bool out_of_range =
      false;  // outside the register's range: an open sensor, a wrong word order, another device
  /// True where the reading may be acted on. The owner of an actuator switches it off where this is false.
  [[nodiscard]] bool is_sound() const { return !stale && !out_of_range; }
};

enum class WriteState {
  none,        // never written
  queued,      // not sent yet
  written,     // the device acknowledged it; the read-back (if the map has one) does not show it yet
  confirmed,   // acknowledged and read back
  refused,     // the device answered with an exception; it did nothing
  expired,     // dropped unsent at its deadline
  uncertain,   // sent, answer lost; the read-back will tell
  lost,        // sent, answer lost, and the read-back shows another value
  mismatched,  // acknowledged, but the read-back shows another value
};
[[nodiscard]] std::string_view name_of(WriteState state);

/// The fate of the latest write to one register.
struct WriteReport {
  std::uint64_t number = 0;  // counts the device's writes from 1
  WriteState state = WriteState::none;
  double wanted = 0.0;  // SI
  int exception = 0;    // Modbus exception code where refused
};

enum class WriteRefusal {
  out_of_range,  // outside the register's range, or no number
};

/// Events of one device since the start, by cause.
struct DeviceCounters {
  std::uint64_t requests = 0;
  std::uint64_t answers = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t resets = 0;
  std::uint64_t short_answers = 0;
  std::uint64_t malformed = 0;
  std::uint64_t unconnected = 0;               // requests for which no connection could be made
  std::array<std::uint64_t, 12> exceptions{};  // by code 1 to 11; [0] the others
  std::uint64_t asked_again = 0;               // after an answer that the device is busy
  std::uint64_t splits = 0;                    // reads that were refused (exceptions 2 and 3) and parted
  std::uint64_t polls = 0;                     // complete rounds of reads
  std::uint64_t heartbeats = 0;                // acknowledged
  std::uint64_t writes = 0;                    // sent
  std::uint64_t writes_superseded = 0;         // replaced unsent by a newer value for the same register
  std::uint64_t writes_unneeded = 0;           // not sent: the device is slow, and shows the value already
  std::uint64_t writes_expired = 0;
  std::uint64_t writes_refused = 0;
  std::uint64_t writes_uncertain = 0;
  std::uint64_t writes_lost = 0;
  std::uint64_t read_back_mismatches = 0;
  std::uint64_t values_out_of_range = 0;  // read, and outside their register's range
};

class DeviceIo;

class Device {
 public:
  /// Made by Bus::add.
  explicit Device(RegisterMap map);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] const RegisterMap& map() const { return map_; }
  /// The register's index, to spare the look-up by name. Precondition: it exists.
  [[nodiscard]] std::size_t index(std::string_view name) const;

  [[nodiscard]] Reading value(std::size_t reg) const;
  [[nodiscard]] Reading value(std::string_view name) const { return value(index(name)); }

  /// Queues a write and returns its number. A queued, unsent write to the same register is replaced;
  /// different registers are written in the order of the calls. Sent by the I/O thread at once, or by the
  /// next `Bus::exchange` or `Bus::send`. Precondition: the register is writable.
  Result<std::uint64_t, WriteRefusal> write(std::size_t reg, double value);
  Result<std::uint64_t, WriteRefusal> write(std::string_view name, double value) {
    return write(index(name), value);
  }
  [[nodiscard]] WriteReport last_write(std::size_t reg) const;
  [[nodiscard]] WriteReport last_write(std::string_view name) const { return last_write(index(name)); }

  /// Writes that were not sent yet never are, and none is looked for in the read-backs: somebody else commands the device now.
  void forget_writes();
  /// The owner lives: the heartbeat goes on for another `heartbeat.refresh_within`.
  void refresh();

  /// The last request was answered, and none has failed since.
  [[nodiscard]] bool is_online() const;
  [[nodiscard]] DeviceCounters counters() const;
  /// Why the last request that failed did; nothing before the first.
  [[nodiscard]] std::optional<Failure> last_failure() const;
  /// How long the last round of heartbeat, writes and all reads took.
  [[nodiscard]] Duration round() const;

 private:
  friend class DeviceIo;
  friend class Bus;
  struct Sample {
    double value;
    Instant stamp;
    bool seen = false;
    bool out_of_range = false;
  };
  struct Pending {
    WriteReport report;
    Instant due;           // the deadline of the state it is in
    bool stamped = false;  // `due` is set: the I/O side has seen it
    std::optional<Instant>
        unshown_since;                  // acknowledged then, and not read back since, however often repeated
    std::optional<Instant> busy_since;  // the device is too busy to take it, however often it is asked
  };

  [[nodiscard]] Duration age(const Sample& sample) const;
  [[nodiscard]] bool is_needed(std::size_t reg, double value) const;

  const RegisterMap map_;
  mutable std::mutex mutex_;  // guards all below
  std::vector<Sample> samples_;
  std::vector<Pending> writes_;  // one slot a register
  std::uint64_t written_ = 0;
  bool has_queued_ = false;
  bool refreshed_ = false;
  bool online_ = false;
  DeviceCounters counters_;
  std::optional<Failure> last_failure_;
  Duration round_;
  Instant polled_now_;     // the clock of `Bus::exchange`; unused once threaded
  bool threaded_ = false;  // ages count on CLOCK_MONOTONIC
  int wake_ = -1;          // eventfd of the I/O thread
};

}  // namespace invar::modbus
