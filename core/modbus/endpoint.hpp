// How a component names its device on Modbus TCP, and keeps or plays it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/health.hpp"
#include "core/modbus/server.hpp"

namespace invar::modbus {

/// Parameters of a component that keeps a device.
struct Endpoint {
  std::string host = "127.0.0.1";
  std::int64_t port = 502;
  std::filesystem::path map;
  void describe(auto& p) {
    p(host, "host", "name or address of the device's controller");
    p(port, "port", 1, 65535, "TCP port");
    p(map, "map", "register map");
  }
  /// "the device at 10.0.0.5:502, unit 1", which can have one master only.
  [[nodiscard]] std::string device(const RegisterMap& registers) const;
  [[nodiscard]] bool is_on_this_pc() const { return host == "localhost" || host.starts_with("127."); }
};

/// Parameters of a component that plays a device.
struct ServedEndpoint {
  std::filesystem::path map;
  std::string host = "127.0.0.1";
  std::int64_t port = 1502;
  std::filesystem::path faults;
  void describe(auto& p) {
    p(map, "map", "register map to serve");
    p(host, "host", "address to listen on");
    p(port, "port", 1, 65535, "TCP port to listen on");
    p(faults, "faults", "fault script: when its Modbus side refuses, drops, delays or lies");
  }
};

/// A register that a component works with: what it measures, by any unit of that kind, and whether it is commanded.
struct Needed {
  std::string name;
  const char* unit = "1";
  bool written = false;
};

/// The map that the parameter `key` names. Throws InputError when it names none, when the file is wrong, and when a register in
/// `needed` is missing, measures something else, or cannot be read or written; `device` is what the map is of, for the message.
[[nodiscard]] RegisterMap load_map_of(const std::filesystem::path& file, const std::string& key,
                                      const std::string& device, std::initializer_list<Needed> needed);
/// The same for one register of a map at hand.
void must_have(const RegisterMap& map, const std::string& key, const std::string& device,
               const Needed& needed);
/// Throws InputError when the register does not take all `values` [SI] that the parameter `key` lets the component write.
void must_take(const RegisterMap& map, const std::string& reg, Range values, const std::string& key);
/// Throws InputError when none of the registers is set to 0 at comm loss: the device would go on when its master is dead.
void must_let_go(const RegisterMap& map, const std::string& key,
                 std::initializer_list<const char*> registers);

/// The device that these parameters describe, listening from now on. Throws InputError as `load_map` and `Server` do.
[[nodiscard]] std::unique_ptr<Server> serve(const ServedEndpoint& parameters);

/// One device on a bus of its own. In simulated time the caller's step moves the bus (`receive` before it reads, `send` after it
/// wrote); by the wall clock the bus's thread does, and both do nothing.
class Client {
 public:
  void open(const Endpoint& endpoint, bool simulated_time);
  void close() noexcept;
  [[nodiscard]] bool is_open() const { return bus_ != nullptr; }
  /// Precondition: open.
  [[nodiscard]] Device& device() const { return *device_; }
  void receive(Instant now);
  void send(Instant now);
  /// Once a cycle, after `receive`: what its owner should say of the device now. Sets the device's watchdog, too, where that shows
  /// another time than the map wants, or the device came back. Precondition: open.
  [[nodiscard]] std::vector<HealthChange> look(Instant now);
  /// The device refused a write lately: let go of it, and let its watchdog do the same.
  [[nodiscard]] bool refuses() const { return health_.refuses(); }

 private:
  void keep_watchdog();

  std::unique_ptr<Bus> bus_;
  Device* device_ = nullptr;
  Health health_;
  bool was_online_ = false;
  bool stepped_ = false;
};

}  // namespace invar::modbus
