// Register maps as devices and people make them: either the check refuses one with a line, or both sides of it run. Nothing aborts.
//
// INVAR_FUZZ_RUNS sets the number of maps (default 500), INVAR_FUZZ_SEED the seed.
#include <gmock/gmock.h>

#include <cstdlib>
#include <memory>
#include <random>
#include <sstream>

#include "components/dispenser/dispenser.hpp"
#include "components/thermal/thermal.hpp"
#include "components/world/simulated_heater.hpp"
#include "components/world/simulated_pneumatics.hpp"
#include "core/base/fault.hpp"
#include "idl/event.h"
#include "tests/support/free_port.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar {
namespace {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

/// A register as a row of a map.
struct Row {
  std::string name, kind, type, unit, access, role, range;
};
struct Device {
  std::vector<Row> rows;
  std::vector<std::vector<std::string>> alike;  // units that measure the same
};

const Device heater{
    {{"power", "holding", "uint16", "W", "read_write", "actuator", "[0, 60]"},
     {"enable", "coil", "bool", "", "read_write", "actuator", ""},
     {"reset_alarms", "coil", "bool", "", "read_write", "setting", ""},
     {"over_temperature_limit", "holding", "int16", "degC", "read_write", "setting", "[0, 150]"},
     {"slide_resistance", "input", "uint32", "ohm", "read", "", "[0, 1000000]"},
     {"slide_temperature", "input", "float32", "degC", "read", "", "[-50, 300]"},
     {"base_resistance", "input", "uint32", "ohm", "read", "", ""},
     {"delivered_power", "input", "uint16", "W", "read", "", ""},
     {"over_temperature", "discrete", "bool", "", "read", "", ""},
     {"sensor_fault", "discrete", "bool", "", "read", "", ""},
     {"comm_lost", "discrete", "bool", "", "read", "", ""}},
    {{"W", "mW", "%", "kW", "1"}, {"degC", "K", "degF"}, {"ohm", "kohm"}}};
const Device pneumatic{{{"pressure", "holding", "int32", "Pa", "read_write", "actuator", "[0, 700000]"},
                        {"purge_pressure", "holding", "int32", "Pa", "read_write", "actuator", "[0, 700000]"},
                        {"band", "holding", "uint16", "Pa", "read_write", "setting", "[10, 50000]"},
                        {"enable", "coil", "bool", "", "read_write", "actuator", ""},
                        {"purge", "coil", "bool", "", "read_write", "actuator", ""},
                        {"reset_alarms", "coil", "bool", "", "read_write", "setting", ""},
                        {"actual_pressure", "input", "float32", "kPa", "read", "", "[-100, 1000]"},
                        {"actual_purge_pressure", "input", "float32", "kPa", "read", "", ""},
                        {"supply_pressure", "input", "float32", "bar", "read", "", ""},
                        {"in_band", "discrete", "bool", "", "read", "", ""},
                        {"supply_low", "discrete", "bool", "", "read", "", ""},
                        {"over_pressure", "discrete", "bool", "", "read", "", ""},
                        {"sensor_fault", "discrete", "bool", "", "read", "", ""},
                        {"comm_lost", "discrete", "bool", "", "read", "", ""}},
                       {{"Pa", "kPa", "bar", "psi", "mbar"}}};

class MapMaker {
 public:
  explicit MapMaker(std::uint64_t seed) : random_{seed} {}

  std::string make(const Device& device) {
    std::ostringstream text;
    const bool has_heartbeat = !one_in(12);
    const double changes = one_in(3) ? 0.0 : 0.15;  // some maps are whole but for what they lack
    text << "invar_modbus_map: 1\ndevice: thing\ngaps: " << (one_in(2) ? "refused" : "readable") << "\n";
    if (one_in(3)) text << "max_registers: " << 2 + below(10) << "\n";
    if (has_heartbeat)
      text << "heartbeat: {register: heartbeat, timeout: 1"
           << (one_in(2) ? ", timeout_register: watchdog}\n" : "}\n");
    std::ostringstream rows, set, hold;
    std::size_t address = below(100);
    for (Row row : device.rows) {
      if (below(100) < 25) continue;
      if (row.role == "actuator") {
        if (one_in(5))
          hold << (hold.str().empty() ? "" : ", ") << row.name;
        else if (!one_in(20))
          set << (set.str().empty() ? "" : ", ") << row.name << ": 0";
      }
      write_row(rows, row, device, changes, address);
      address += 2 + below(3);
    }
    rows << "  heartbeat: {address: " << address
         << ", kind: holding, type: " << (one_in(4) ? "int32" : "uint16")
         << ", access: read_write, role: setting}\n"
         << "  watchdog: {address: " << address + 2
         << ", kind: holding, type: uint16, unit: ms, access: read_write, role: setting}\n";
    text << "comm_loss: {set: {" << set.str() << "}, hold: [" << hold.str() << "]}\nregisters:\n"
         << rows.str();
    return text.str();
  }
  std::size_t below(std::size_t limit) { return random_() % limit; }
  bool one_in(std::size_t n) { return below(n) == 0; }

 private:
  bool chance(double share) { return std::uniform_real_distribution<double>{}(random_) < share; }
  template <class T>
  T any(std::initializer_list<T> list) {
    return *(list.begin() + static_cast<std::ptrdiff_t>(below(list.size())));
  }
  void write_row(std::ostream& out, Row& row, const Device& device, double changes, std::size_t address) {
    bool changed_unit = false;
    for (const auto& units : device.alike)
      if (std::find(units.begin(), units.end(), row.unit) != units.end() && one_in(3)) {
        row.unit = units[below(units.size())];
        changed_unit = true;
        break;
      }
    if (chance(changes)) row.unit = any({"V", "m", "s", "degC", "W", "1"});
    if (chance(changes)) row.access = any({"read", "write", "read_write"});
    if (chance(changes)) row.kind = any({"holding", "input", "coil", "discrete"});
    if (chance(changes)) row.type = any({"bool", "uint16", "int16", "uint32", "int32", "float32"});
    if (row.kind == "coil" || row.kind == "discrete") row.type = "bool";
    out << "  " << row.name << ": {address: " << address << ", kind: " << row.kind << ", type: " << row.type
        << ", access: " << row.access;
    if (row.access != "read") out << ", role: " << (row.role.empty() ? "setting" : row.role);
    if (row.role == "actuator" && row.access == "read_write") out << ", read_back: self";
    if (row.type == "bool" && row.kind != "coil" && row.kind != "discrete") out << ", bit: " << below(16);
    if (row.type != "bool") {
      if (!row.unit.empty()) out << ", unit: \"" << row.unit << "\"";
      if (changed_unit || chance(changes))
        out << ", scale: " << any({"1", "0.1", "0.001", "-1", "1e-3", "100", "1e-300", "1e30", "1e300"});
      else if (!row.range.empty() && row.type != "float32")
        out << ", range: " << row.range;
      if (chance(changes)) out << ", offset: " << any({"0", "-100", "1e12"});
    }
    out << "}\n";
  }
  std::mt19937_64 random_;
};

struct Result {
  int refused = 0;
  int ran = 0;
};

/// Makes what `make` gives; false, and the fault's line looked at, where the check refuses the map.
template <class Make>
bool makes(const Make& make, const std::string& map) {
  try {
    make();
    return true;
  } catch (const InputError& error) {
    EXPECT_FALSE(error.faults().empty()) << map;
    for (const Fault& fault : error.faults()) {
      EXPECT_FALSE(fault.what.empty()) << map;
      EXPECT_EQ(fault.line().find('\n'), std::string::npos) << fault.line();
    }
    return false;
  }
}

/// Both sides in simulated time, the owner told this and that.
template <class Owner, class Command>
void run(Component& device, Owner& owner, const std::function<Command(int)>& command) {
  struct Teller final : Component {
    Output<Command> command{*this, "command"};
    void step(const Tick&) noexcept override {}
  } teller;
  for (Component* component : {&device, static_cast<Component*>(&owner)}) {
    component->simulated_time = true;
    component->configure();
  }
  teller.command.connect(*static_cast<InputPort*>(owner.find_port("command")));
  device.activate();
  owner.activate();
  for (int cycle = 0; cycle < 12; ++cycle) {
    const Tick tick{Instant{} + Duration::milliseconds(100) * cycle, 0.1, static_cast<std::uint64_t>(cycle)};
    for (Component* component : {&device, static_cast<Component*>(&owner), static_cast<Component*>(&teller)})
      component->set_now(tick.now);
    if (cycle % 3 == 2) teller.command.write(command(cycle));
    device.step(tick);
    owner.step(tick);
  }
  owner.deactivate();
  owner.cleanup();
  device.cleanup();
}

thermal::ThermalCommand thermal_command(int cycle) {
  thermal::ThermalCommand command;
  command.setpoint(cycle == 2 ? 45.0 : 20.0);
  command.enabled(cycle != 8);
  command.reset_latch(cycle == 5);
  return command;
}

dispensing::PressureCommand pressure_command(int cycle) {
  dispensing::PressureCommand command;
  command.setpoint(cycle == 2 ? 20e3 : 0.0);
  command.enabled(cycle != 8);
  command.purge(cycle == 5);
  command.purge_setpoint(cycle == 5 ? 10e3 : 0.0);
  command.reset_alarms(cycle == 8);
  return command;
}

TEST(RegisterMaps, AreRefusedWithALineOrRun) {
  const std::uint64_t seed = from_environment("INVAR_FUZZ_SEED", 30);
  const std::uint64_t runs = from_environment("INVAR_FUZZ_RUNS", 500);
  std::cout << "seed " << seed << ", " << runs << " maps\n";
  const invar::testing::TemporaryFolder folder;
  MapMaker maker{seed};
  Result heaters, pneumatics;
  for (std::uint64_t i = 0; i < runs; ++i) {
    const bool heats = i % 2 == 0;
    const std::string text = maker.make(heats ? heater : pneumatic);
    const auto map = folder.write("map.yaml", text);
    const std::int64_t port = test::free_port();
    SCOPED_TRACE("map " + std::to_string(i) + "\n" + text);
    bool ran = false;
    if (heats) {
      world::SimulatedHeater::Parameters device_parameters;
      device_parameters.modbus.map = map;
      device_parameters.modbus.port = port;
      thermal::Thermal::Parameters parameters;
      parameters.modbus.map = map;
      parameters.modbus.port = port;
      parameters.rated_power = maker.one_in(8) ? 0.0 : 60.0;
      if (maker.one_in(3)) parameters.zones = {{"base", {}}};
      std::unique_ptr<world::SimulatedHeater> device;
      std::unique_ptr<thermal::Thermal> owner;
      ran = makes([&] { device = std::make_unique<world::SimulatedHeater>(device_parameters); }, text) &&
            makes([&] { owner = std::make_unique<thermal::Thermal>(parameters); }, text);
      if (ran) run<thermal::Thermal, thermal::ThermalCommand>(*device, *owner, thermal_command);
      ++(ran ? heaters.ran : heaters.refused);
    } else {
      world::SimulatedPneumatics::Parameters device_parameters;
      device_parameters.modbus.map = map;
      device_parameters.modbus.port = port;
      dispenser::Dispenser::Parameters parameters;
      parameters.modbus.map = map;
      parameters.modbus.port = port;
      parameters.pressurise = true;
      std::unique_ptr<world::SimulatedPneumatics> device;
      std::unique_ptr<dispenser::Dispenser> owner;
      ran = makes([&] { device = std::make_unique<world::SimulatedPneumatics>(device_parameters); }, text) &&
            makes([&] { owner = std::make_unique<dispenser::Dispenser>(parameters); }, text);
      if (ran) run<dispenser::Dispenser, dispensing::PressureCommand>(*device, *owner, pressure_command);
      ++(ran ? pneumatics.ran : pneumatics.refused);
    }
  }
  std::cout << "heater: " << heaters.ran << " ran, " << heaters.refused
            << " refused; pneumatic: " << pneumatics.ran << " ran, " << pneumatics.refused << " refused\n";
  for (const Result& result : {heaters, pneumatics}) {
    EXPECT_GT(result.ran, static_cast<int>(runs / 40));
    EXPECT_GT(result.refused, static_cast<int>(runs / 40));
  }
}

}  // namespace
}  // namespace invar
