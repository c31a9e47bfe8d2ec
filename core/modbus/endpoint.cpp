#include "core/modbus/endpoint.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <utility>

#include "core/base/fault.hpp"

namespace invar::modbus {

bool is_host(const std::string& text) {
  std::array<unsigned char, 16> address{};
  if (inet_pton(AF_INET, text.c_str(), address.data()) == 1 ||
      inet_pton(AF_INET6, text.c_str(), address.data()) == 1)
    return true;
  const auto is_of_name = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.';
  };
  const auto last =
      text.substr(text.find_last_of('.') + 1);  // RFC 3696: the last label of a name is no number
  const bool is_number = last.starts_with("0x") || last.find_first_not_of("0123456789") == std::string::npos;
  return !is_number && std::all_of(text.begin(), text.end(), is_of_name);
}

std::string Endpoint::device(const RegisterMap& registers) const {
  const std::string address = host == "localhost" ? "127.0.0.1" : host;
  return "the device at " + address + ":" + std::to_string(port) + ", unit " + std::to_string(registers.unit);
}

std::string Endpoint::connection() const {
  return "the connection to " + (host == "localhost" ? "127.0.0.1" : host) + ":" + std::to_string(port);
}

RegisterMap load_map_of(const std::filesystem::path& file, const std::string& key,
                        const std::string& device) {
  if (file.empty()) throw InputError{key, "missing", "name the " + device + "'s register map"};
  return load_map(file);
}

std::unique_ptr<Server> serve(const ServedEndpoint& parameters, const RegisterMap& map) {
  ServerOptions options{.host = parameters.host, .port = static_cast<std::uint16_t>(parameters.port)};
  if (!parameters.faults.empty()) options.faults = load_faults(parameters.faults, map);
  return std::make_unique<Server>(map, std::move(options));
}

void Client::open(const Endpoint& endpoint, RegisterMap map, bool simulated_time) {
  BusOptions options{.host = endpoint.host, .port = static_cast<std::uint16_t>(endpoint.port)};
  // Waits are real also in simulated time, where a busy host must not look like a dead device.
  if (simulated_time) options.answer_timeout = Duration::seconds(20);
  bus_ = shared_bus(options, simulated_time);
  device_ = &bus_->add(std::move(map));
  stepped_ = simulated_time;
  health_ = Health{endpoint.host + ":" + std::to_string(endpoint.port)};
}

void Client::close() noexcept {
  if (bus_) bus_->remove(*device_);
  bus_.reset();
  device_ = nullptr;
}

std::optional<Reading> Client::reading(std::optional<std::size_t> reg) const {
  return reg ? std::optional{device_->value(*reg)} : std::nullopt;
}

bool Client::flag(std::optional<std::size_t> reg) const {
  const auto shown = reading(reg);
  return shown && !shown->stale && shown->value != 0.0;
}

bool Client::write(std::optional<std::size_t> reg, double value) {
  return !reg || device_->write(*reg, value).ok();
}

void Client::receive(Instant now) {
  if (stepped_) bus_->exchange(now, device_);
}

void Client::send(Instant now) {
  if (stepped_) bus_->send(now, device_);
}

/// A device that starts anew, or that somebody else wrote to, may wait longer for a heartbeat than its owner counts on.
void Client::keep_watchdog() {
  const RegisterMap& map = device_->map();
  const bool came_back = device_->is_online() && !was_online_;
  was_online_ = device_->is_online();
  if (!map.heartbeat || !map.heartbeat->timeout_setting) return;
  const std::size_t index = *map.heartbeat->timeout_setting;
  const Register& reg = map.registers[index];
  if (!reg.writable) return;
  const double wanted = map.heartbeat->timeout.in_seconds();
  if (reg.readable) {
    const Reading shown = device_->value(index);
    if (shown.stale || std::abs(shown.value - wanted) <= 0.5 * std::abs(reg.scale) + 1e-6 * wanted) return;
    const WriteState state = device_->last_write(index).state;
    if (state == WriteState::queued || (state == WriteState::written && reg.read_back)) return;
  } else if (!came_back) {
    return;
  }
  (void)device_->write(index, wanted);  // in its range: checked with the map
}

std::vector<HealthChange> Client::look(Instant now) {
  keep_watchdog();
  return health_.look(*device_, bus_->counters(), now);
}

}  // namespace invar::modbus
