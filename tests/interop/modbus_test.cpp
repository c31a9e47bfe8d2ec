// Our Modbus server and client against independent peers: mbpoll and pymodbus.
#include <gmock/gmock.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/base/clock.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/server.hpp"
#include "tests/support/process.hpp"

namespace invar::modbus {
namespace {

using nlohmann::json;
using test::Process;
using ::testing::HasSubstr;

const std::string python = "/usr/bin/python3";  // pymodbus is installed for the system's own
const std::string here = INVAR_SOURCE_DIR "/tests/interop/";

RegisterMap heater_map() { return load_map(INVAR_SOURCE_DIR "/deployment/maps/heater.yaml"); }

/// Reads or writes once with mbpoll and gives its output.
std::string mbpoll(std::uint16_t port, const std::vector<std::string>& options,
                   const std::vector<std::string>& values = {}) {
  std::vector<std::string> command{"mbpoll", "-m", "tcp", "-p", std::to_string(port), "-a", "1", "-0",
                                   "-1",     "-q", "-o",  "10"};
  command.insert(command.end(), options.begin(), options.end());
  command.emplace_back("127.0.0.1");
  if (!values.empty()) command.emplace_back("--");
  command.insert(command.end(), values.begin(), values.end());
  Process process{command};
  return process.rest();
}

bool comes_true(const std::function<bool()>& fact) {
  const Instant watchdog = monotonic_now() + Duration::seconds(90);
  while (!fact()) {
    if (monotonic_now() > watchdog) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  return true;
}

TEST(ModbusPeers, MbpollReadsOurServer) {
  Server heater{heater_map(), {}};
  heater.set("slide_temperature", 30.125);
  heater.set("pad_temperature", -1.5);
  heater.set("slide_resistance", 805.436);
  heater.exchange({});
  EXPECT_THAT(mbpoll(heater.port(), {"-t", "3:float", "-B", "-r", "4"}), HasSubstr("[4]: \t30.125\n"));
  EXPECT_THAT(mbpoll(heater.port(), {"-t", "3:int", "-B", "-r", "0"}), HasSubstr("[0]: \t805436\n"));
  EXPECT_THAT(mbpoll(heater.port(), {"-t", "3", "-r", "8"}), HasSubstr("[8]: \t65386 (-150)\n"));
  EXPECT_THAT(mbpoll(heater.port(), {"-t", "4", "-r", "2", "-c", "2"}),
              ::testing::AllOf(HasSubstr("[2]: \t1000\n"), HasSubstr("[3]: \t800\n")));
}

TEST(ModbusPeers, MbpollWritesOurServer) {
  Server heater{heater_map(), {}};
  heater.exchange({});
  mbpoll(heater.port(), {"-t", "4", "-r", "3"}, {"655"});
  mbpoll(heater.port(), {"-t", "0", "-r", "1"}, {"1"});
  heater.exchange({});
  EXPECT_NEAR(heater.value("over_temperature_limit"), 65.5, 1e-9);
  EXPECT_EQ(heater.value("reset_alarms"), 1.0);
  mbpoll(heater.port(), {"-t", "4", "-r", "3"}, {"2000"});  // 200 degC: above the range
  heater.exchange({});
  EXPECT_NEAR(heater.value("over_temperature_limit"), 65.5, 1e-9);
}

TEST(ModbusPeers, PymodbusReadsAndWritesOurServer) {
  Server heater{heater_map(), {}};
  heater.set("slide_resistance", 805.436);
  heater.set("base_resistance", 1250.761);
  heater.set("slide_temperature", 30.125);
  heater.set("base_temperature", 20.5);
  heater.set("pad_temperature", -1.5);
  heater.set("delivered_power", 12.34);
  heater.set("ready", 1);
  heater.exchange({});
  Process master{{python, here + "modbus_master.py", std::to_string(heater.port())}};
  const json seen = json::parse(master.line());
  EXPECT_EQ(seen["slide_resistance"], 805436);
  EXPECT_EQ(seen["base_resistance"], 1250761);
  EXPECT_EQ(seen["slide_temperature"], 30.125);
  EXPECT_EQ(seen["base_temperature"], 20.5);
  EXPECT_EQ(seen["pad_temperature"], -150);
  EXPECT_EQ(seen["delivered_power"], 1234);
  EXPECT_EQ(seen["status"], 0b10001);  // ready, and comm_lost before the first heartbeat
  EXPECT_EQ(seen["coils"], json::parse("[false, false]"));
  EXPECT_EQ(seen["beyond"], 2);
  EXPECT_EQ(seen["above_range"], 3);
  EXPECT_EQ(seen["other_unit"], 11);
  EXPECT_EQ(seen["power_read_back"], 1234);
  heater.exchange({});
  EXPECT_FALSE(heater.comm_lost());
  EXPECT_NEAR(heater.value("power"), 12.34, 1e-9);
  EXPECT_EQ(heater.value("enable"), 1.0);
}

RegisterMap peer_map(int unit) {
  return parse_map(
      "invar_modbus_map: 1\ndevice: peer\nunit: " + std::to_string(unit) +
          "\n"
          "gaps: readable\n"
          "poll: 0.02\n"
          "timeouts: {answer: 1, write: 30, read_back: 30, stale: 2}\n"
          "heartbeat: {register: heartbeat, period: 0.1, refresh_within: 60, timeout: 1}\n"
          "comm_loss: {set: {power: 0}}\n"
          "registers:\n"
          "  power: {address: 0, kind: holding, type: uint16, scale: 0.1, unit: W, access: read_write,\n"
          "          role: actuator, read_back: self}\n"
          "  gain: {address: 2, kind: holding, type: float32, word_order: cdab, access: read_write,\n"
          "         role: setting, read_back: self}\n"
          "  offset: {address: 4, kind: holding, type: int32, access: read_write, role: setting, read_back: "
          "self}\n"
          "  heartbeat: {address: 6, kind: holding, type: uint16, access: read_write, role: setting}\n"
          "  lamp: {address: 1, kind: coil, type: bool, access: read_write, role: setting, read_back: self}\n"
          "  door: {address: 2, kind: discrete, type: bool, access: read}\n"
          "  temperature: {address: 0, kind: input, type: float32, unit: degC, access: read}\n"
          "  voltage: {address: 2, kind: input, type: int16, scale: 0.001, unit: V, access: read}\n"
          "  hours: {address: 10, kind: input, type: uint32, word_order: cdab, access: read}\n"
          "  alarm: {address: 12, bit: 2, kind: input, type: bool, access: read}\n"
          "  calm: {address: 12, bit: 3, kind: input, type: bool, access: read}\n",
      "peer.yaml");
}

TEST(ModbusPeers, OurClientReadsAndWritesPymodbus) {
  Process peer{{python, here + "modbus_device.py", "0"}};
  const auto port = static_cast<std::uint16_t>(std::stoi(peer.line()));
  Bus bus{{.port = port, .answer_timeout = Duration::seconds(20)}};
  Device& first = bus.add(peer_map(1));
  Device& second = bus.add(peer_map(2));
  first.refresh();
  (void)first.write("power", 123.4);
  (void)first.write("gain", 2.5);
  (void)first.write("offset", -100000);
  (void)first.write("lamp", 1);
  (void)second.write("power", 7.0);
  ASSERT_TRUE(bus.exchange({}));
  EXPECT_DOUBLE_EQ(first.value("temperature").value, 31.125);
  EXPECT_DOUBLE_EQ(second.value("temperature").value, 32.125);
  EXPECT_DOUBLE_EQ(first.value("voltage").value, -1.234);
  EXPECT_EQ(first.value("hours").value, 4e9);
  EXPECT_EQ(first.value("alarm").value, 1.0);
  EXPECT_EQ(first.value("calm").value, 0.0);
  EXPECT_EQ(first.value("door").value, 1.0);
  for (const auto* name : {"power", "gain", "offset", "lamp"})
    EXPECT_EQ(first.last_write(name).state, WriteState::confirmed) << name;
  EXPECT_EQ(first.counters().requests, 5U + 4U);  // heartbeat, four writes, one read a kind

  peer.send("");
  const json held = json::parse(peer.line());
  // 2.5 is 0x40200000, low word first; -100000 is 0xFFFE7960.
  EXPECT_EQ(held["1"]["holding"], json::parse("[1234, 0, 0, 16416, 65534, 31072, 1, 0, 0, 0]"));
  EXPECT_EQ(held["1"]["coils"], json::parse("[false, true]"));
  EXPECT_EQ(held["2"]["holding"][0], 70);
}

TEST(ModbusPeers, OurClientOutlivesAPymodbusServerThatIsKilledAndStartedAgain) {
  auto peer = std::make_unique<Process>(std::vector<std::string>{python, here + "modbus_device.py", "0"});
  const auto port = static_cast<std::uint16_t>(std::stoi(peer->line()));
  Bus bus{{.port = port, .longest_retry = Duration::milliseconds(200)}};
  Device& device = bus.add(peer_map(1));
  bus.start();
  device.refresh();
  (void)device.write("power", 50);
  ASSERT_TRUE(comes_true([&] { return device.last_write("power").state == WriteState::confirmed; }));
  peer->kill();
  ASSERT_TRUE(comes_true([&] { return !device.is_online() && bus.counters().refused > 0; }));
  ASSERT_TRUE(comes_true([&] { return device.value("temperature").stale; }));
  peer = std::make_unique<Process>(
      std::vector<std::string>{python, here + "modbus_device.py", std::to_string(port)});
  ASSERT_EQ(peer->line(), std::to_string(port));
  ASSERT_TRUE(comes_true([&] { return !device.value("temperature").stale; }));
  // The new device knows nothing of the old setpoint, and nobody repeats it behind the owner's back.
  EXPECT_TRUE(comes_true([&] { return device.value("power").value == 0.0; }));
  (void)device.write("power", 60);
  EXPECT_TRUE(comes_true([&] { return device.last_write("power").state == WriteState::confirmed; }));
  EXPECT_EQ(device.counters().writes, 2U);
}

TEST(ModbusPeers, ASilentUnitBehindAGatewayDoesNotHoldUpItsNeighbour) {
  Process peer{{python, here + "modbus_device.py", "0"}};
  const auto port = static_cast<std::uint16_t>(std::stoi(peer.line()));
  Bus bus{{.port = port, .answer_timeout = Duration::milliseconds(700)}};
  Device& silent = bus.add(peer_map(7));
  Device& neighbour = bus.add(peer_map(2));
  bus.start();
  ASSERT_TRUE(comes_true([&] { return silent.counters().timeouts >= 2 && neighbour.counters().polls > 20; }));
  EXPECT_TRUE(silent.value("temperature").stale);
  EXPECT_FALSE(neighbour.value("temperature").stale);
}

}  // namespace
}  // namespace invar::modbus
