// How a component names its device on Modbus TCP, and keeps or plays it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/health.hpp"
#include "core/modbus/server.hpp"

namespace invar::modbus {

/// A name, or an address written in full. `127.1` and `0177.0.0.1` are other spellings of an address, by which two components
/// would take one device for two.
[[nodiscard]] bool is_host(const std::string& text);

/// Parameters of a component that keeps a device.
struct Endpoint {
  std::string host = "127.0.0.1";
  std::int64_t port = 502;
  std::filesystem::path map;
  bool several_masters = false;
  void describe(auto& p) {
    p(host, "host", "name or address of the device's controller");
    if constexpr (requires { p.node(); })
      if (!is_host(host))
        p.node()["host"].fault("`" + host + "` is no host", "write a name, or an address as 10.0.0.5");
    p(port, "port", 1, 65535, "TCP port");
    p(map, "map", "register map");
    p(several_masters, "several_masters",
      "it takes a connection of each process; otherwise those that share it must be in one process");
  }
  /// "the device at 10.0.0.5:502, unit 1", which can have one master only.
  [[nodiscard]] std::string device(const RegisterMap& registers) const;
  /// "the connection to 10.0.0.5:502", which one process keeps for all its devices there.
  [[nodiscard]] std::string connection() const;
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

/// The map that the parameter `key` names, of a `device` in words. Throws InputError when it names none or the file is wrong.
[[nodiscard]] RegisterMap load_map_of(const std::filesystem::path& file, const std::string& key,
                                      const std::string& device);

/// The device with this map that these parameters describe, listening from now on. Throws InputError as `load_faults` and `Server`
/// do.
[[nodiscard]] std::unique_ptr<Server> serve(const ServedEndpoint& parameters, const RegisterMap& map);

/// One device on the process's bus to its host and port. In simulated time the caller's step moves the device (`receive` before
/// it reads, `send` after it wrote); by the wall clock the bus's thread does, and both do nothing.
class Client {
 public:
  Client() = default;
  ~Client() { close(); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  void open(const Endpoint& endpoint, RegisterMap map, bool simulated_time);
  void close() noexcept;
  [[nodiscard]] bool is_open() const { return bus_ != nullptr; }
  /// Precondition: open.
  [[nodiscard]] Device& device() const { return *device_; }
  /// Reading of a register that the map may lack; empty there.
  [[nodiscard]] std::optional<Reading> reading(std::optional<std::size_t> reg) const;
  /// A flag that is shown, fresh and not 0.
  [[nodiscard]] bool flag(std::optional<std::size_t> reg) const;
  /// Nothing happens where the map lacks it; false where the register does not take the value.
  bool write(std::optional<std::size_t> reg, double value);
  void receive(Instant now);
  void send(Instant now);
  /// Once a cycle, after `receive`: what its owner should say of the device now. Sets the device's watchdog, too, where that shows
  /// another time than the map wants, or the device came back. Precondition: open.
  [[nodiscard]] std::vector<HealthChange> look(Instant now);
  /// The device refused a write lately: switch its actuator off, and let its watchdog do the same.
  [[nodiscard]] bool refuses() const { return health_.refuses(); }

 private:
  void keep_watchdog();

  std::shared_ptr<Bus> bus_;
  Device* device_ = nullptr;
  Health health_;
  bool was_online_ = false;
  bool stepped_ = false;
};

}  // namespace invar::modbus
