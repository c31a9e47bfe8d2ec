#include "core/modbus/map.hpp"

#include <gmock/gmock.h>

#include "core/base/fault.hpp"

namespace invar::modbus {
namespace {

const Register& named(const RegisterMap& map, std::string_view name) {
  return map.registers[*map.find(name)];
}

TEST(RegisterMap, ReadsTheHeatersMapInSi) {
  const RegisterMap map = load_map(INVAR_SOURCE_DIR "/deployment/maps/heater.yaml");
  EXPECT_EQ(map.device, "heater");
  EXPECT_EQ(map.poll, Duration::milliseconds(100));
  EXPECT_EQ(map.heartbeat->timeout, Duration::seconds(1));
  const Register& power = named(map, "power");
  EXPECT_TRUE(power.is_actuator);
  EXPECT_EQ(map.registers[*power.read_back].name, "power");
  EXPECT_EQ(power.range.upper, 200.0);
  const Register& timeout = named(map, "watchdog_timeout");
  EXPECT_DOUBLE_EQ(timeout.scale, 1e-3);
  EXPECT_DOUBLE_EQ(timeout.range.upper, 10.0);
  EXPECT_DOUBLE_EQ(timeout.initial, 1.0);
  EXPECT_EQ(map.comm_loss.set.size(), 2U);
}

TEST(RegisterMap, AnActuatorThatIsSafeWhenOnSaysWhy) {
  const std::string vented =
      "invar_modbus_map: 1\ndevice: valves\nheartbeat: {register: beat, timeout: 1}\n"
      "comm_loss: {set: {vent: {value: 1, because: open it lets the pressure out}, pump: 0}}\nregisters:\n"
      "  vent: {address: 0, kind: coil, type: bool, access: read_write, role: actuator, read_back: self}\n"
      "  pump: {address: 1, kind: coil, type: bool, access: read_write, role: actuator, read_back: self}\n"
      "  beat: {address: 0, kind: holding, type: uint16, access: read_write, role: setting}\n";
  const RegisterMap map = parse_map(vented, "valves.yaml");
  ASSERT_EQ(map.comm_loss.set.size(), 2U);
  EXPECT_EQ(map.comm_loss.set[0].value, 1.0);
  EXPECT_EQ(map.comm_loss.set[1].value, 0.0);
}

TEST(RegisterMap, ConvertsUnitScaleOffsetAndRangeOnce) {
  const RegisterMap map = load_map(INVAR_SOURCE_DIR "/deployment/maps/pneumatic.yaml");
  EXPECT_EQ(named(map, "pressure").word_order, WordOrder::cdab);
  EXPECT_DOUBLE_EQ(named(map, "actual_pressure").scale, 1e3);
  EXPECT_DOUBLE_EQ(named(map, "supply_pressure").range.upper, 16e5);
  const RegisterMap warm = parse_map(
      "invar_modbus_map: 1\ndevice: warm\nregisters:\n"
      "  a: {address: 0, kind: input, type: uint16, scale: 0.1, unit: K, range: [273.15, 373.15], access: "
      "read}\n"
      "  b: {address: 1, kind: input, type: int16, scale: 2, offset: 10, unit: mm, access: read}\n",
      "warm.yaml");
  EXPECT_NEAR(named(warm, "a").range.lower, 0.0, 1e-9);
  EXPECT_NEAR(named(warm, "a").offset, -273.15, 1e-9);
  EXPECT_DOUBLE_EQ(named(warm, "b").offset, 0.010);
  EXPECT_DOUBLE_EQ(named(warm, "b").scale, 0.002);
}

TEST(RegisterMap, ReportsEveryFaultOfAFileAtOnce) {
  try {
    (void)parse_map(
        "invar_modbus_map: 1\ndevice: d\nunit: 300\nregisters:\n"
        "  a: {address: 0, kind: input, type: float64, access: read}\n"
        "  b: {address: 70000, kind: input, type: int16, access: read, colour: red}\n",
        "d.yaml");
    FAIL() << "no fault found";
  } catch (const InputError& error) {
    EXPECT_EQ(error.faults().size(), 4U);
  }
}

}  // namespace
}  // namespace invar::modbus
