#include "core/modbus/endpoint.hpp"

#include <utility>

#include "core/base/fault.hpp"

namespace invar::modbus {

RegisterMap load_map_of(const std::filesystem::path& file, const std::string& key, const std::string& device,
                        std::initializer_list<const char*> needed) {
  if (file.empty()) throw InputError{key, "missing", "name the " + device + "'s register map"};
  RegisterMap map = load_map(file);
  for (const char* reg : needed)
    if (!map.find(reg))
      throw InputError{key, std::string{"has no register `"} + reg + "`",
                       "name a " + device + "'s register map"};
  return map;
}

std::unique_ptr<Server> serve(const ServedEndpoint& parameters) {
  RegisterMap map = load_map(parameters.map);
  ServerOptions options{.host = parameters.host, .port = static_cast<std::uint16_t>(parameters.port)};
  if (!parameters.faults.empty()) options.faults = load_faults(parameters.faults, map);
  return std::make_unique<Server>(std::move(map), std::move(options));
}

void Client::open(const Endpoint& endpoint, bool simulated_time) {
  BusOptions options{.host = endpoint.host, .port = static_cast<std::uint16_t>(endpoint.port)};
  // Waits are real also in simulated time, where a busy host must not look like a dead device.
  if (simulated_time) options.answer_timeout = Duration::seconds(20);
  bus_ = std::make_unique<Bus>(std::move(options));
  device_ = &bus_->add(load_map(endpoint.map));
  stepped_ = simulated_time;
  if (!stepped_) bus_->start();
}

void Client::close() noexcept {
  bus_.reset();
  device_ = nullptr;
}

void Client::receive(Instant now) {
  if (stepped_) bus_->exchange(now);
}

void Client::send(Instant now) {
  if (stepped_) bus_->send(now);
}

}  // namespace invar::modbus
