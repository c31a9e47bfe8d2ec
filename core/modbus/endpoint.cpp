#include "core/modbus/endpoint.hpp"

#include <cmath>
#include <sstream>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/unit.hpp"

namespace invar::modbus {

namespace {

/// From SI to the unit that the map is written in.
Conversion conversion_from_si(const std::string& unit) {
  const Unit to = parse_unit(unit).value_or(Unit{});
  return {1.0 / to.factor, -to.offset / to.factor};
}

}  // namespace

std::string Endpoint::device(const RegisterMap& registers) const {
  const std::string address = host == "localhost" ? "127.0.0.1" : host;
  return "the device at " + address + ":" + std::to_string(port) + ", unit " + std::to_string(registers.unit);
}

RegisterMap load_map_of(const std::filesystem::path& file, const std::string& key, const std::string& device,
                        std::initializer_list<Needed> needed) {
  if (file.empty()) throw InputError{key, "missing", "name the " + device + "'s register map"};
  RegisterMap map = load_map(file);
  for (const Needed& reg : needed) must_have(map, key, device, reg);
  return map;
}

void must_have(const RegisterMap& map, const std::string& key, const std::string& device,
               const Needed& needed) {
  const std::string named = "register `" + needed.name + "`";
  const auto index = map.find(needed.name);
  if (!index) throw InputError{key, "has no " + named, "name a " + device + "'s register map"};
  const Register& reg = map.registers[*index];
  if (!conversion(reg.unit, needed.unit))
    throw InputError{key,
                     named + " is in `" + reg.unit + "`, and is needed in a unit like `" + needed.unit + "`",
                     "correct the register's `unit` in the map"};
  if (needed.written && !reg.writable)
    throw InputError{key, named + " cannot be written", "give it `access: read_write` in the map"};
  if (!needed.written && !reg.readable)
    throw InputError{key, named + " cannot be read", "give it `access: read` in the map"};
}

void must_take(const RegisterMap& map, const std::string& name, Range values, const std::string& key) {
  const Register& reg = map.registers[map.find(name).value()];
  const double asked = reg.range.contains(values.upper) ? values.lower : values.upper;
  if (reg.range.contains(asked)) return;
  const Conversion shown = conversion_from_si(reg.unit);
  std::ostringstream what;
  what << "asks register `" << name << "` for " << shown(asked) << " " << reg.unit
       << ", and the map's range is " << shown(reg.range.lower) << " to " << shown(reg.range.upper);
  throw InputError{key, what.str(),
                   "stay inside, or correct the register's `range` if the device takes more"};
}

void must_let_go(const RegisterMap& map, const std::string& key,
                 std::initializer_list<const char*> registers) {
  std::string names;
  for (const char* name : registers) {
    const auto index = map.find(name);
    for (const CommLoss::Set& set : map.comm_loss.set)
      if (set.reg == index && set.value == 0.0) return;
    names += (names.empty() ? "`" : " or `") + std::string{name} + "`";
  }
  throw InputError{key, "does not switch the device off when its master is lost",
                   "set " + names + " to 0 under `comm_loss.set` of the map"};
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
  health_ = Health{endpoint.host + ":" + std::to_string(endpoint.port)};
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
