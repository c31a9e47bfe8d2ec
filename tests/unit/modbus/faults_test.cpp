// Client and simulated device under scripted faults, in simulated time: causes, staleness, back-off, writes.
#include <gmock/gmock.h>

#include <ostream>
#include <string>

#include "core/modbus/bus.hpp"
#include "core/modbus/server.hpp"

namespace invar::modbus {
namespace {

RegisterMap echo_map() {
  return parse_map(
      "invar_modbus_map: 1\n"
      "device: valve\n"
      "timeouts: {answer: 0.1, write: 1, read_back: 0.5, stale: 0.5}\n"
      "heartbeat: {register: heartbeat, period: 0.2, timeout: 1}\n"
      "comm_loss: {set: {opening: 0}}\n"
      "registers:\n"
      "  opening: {address: 0, kind: holding, type: uint16, range: [0, 100], access: read_write,\n"
      "            role: actuator, read_back: echo}\n"
      "  heartbeat: {address: 1, kind: holding, type: uint16, access: read_write, role: setting}\n"
      "  setting: {address: 2, kind: holding, type: int32, access: read_write, role: setting, read_back: "
      "self}\n"
      "  echo: {address: 0, kind: input, type: uint16, access: read}\n"
      "  flow: {address: 1, kind: input, type: float32, access: read}\n",
      "valve.yaml");
}

/// Device and master stepped in turn every 100 ms of simulated time; the valve shows its opening after a step.
struct Cell {
  // Patient, since a busy host is no fault of the cell; a script whose answers stay away says how long to wait.
  explicit Cell(const std::string& faults, Duration answer_timeout = Duration::seconds(20))
      : server{echo_map(),
               {.faults = parse_faults("invar_modbus_faults: 1\nfaults:\n" + faults, "f.yaml", echo_map())}},
        bus{{.port = server.port(), .answer_timeout = answer_timeout}},
        valve{bus.add(echo_map())} {}

  bool step() {
    now += Duration::milliseconds(100);
    server.set("flow", now.in_seconds());
    server.set("echo", is_stuck ? 0.0 : server.value("opening"));
    server.exchange(now);
    if (lives) valve.refresh();
    return bus.exchange(now);
  }
  void run_until(double seconds) {
    while (now < Instant{} + Duration::seconds(seconds)) step();
  }

  bool lives = false;  // whether the heartbeat goes on
  bool is_stuck = false;
  Instant now;
  Server server;
  Bus bus;
  Device& valve;
};

struct Expected {
  std::string fault;
  std::uint64_t DeviceCounters::*counter;
  Duration answer_timeout = Duration::seconds(20);
};
void PrintTo(const Expected& expected, std::ostream* out) { *out << expected.fault; }

class FaultOnARead : public ::testing::TestWithParam<Expected> {};

TEST_P(FaultOnARead, IsCountedUnderItsCauseAndOvercome) {
  // The script counts from the first step, at 0.1 s.
  Cell cell{"  - {at: 0.9, for: 0.05, on: reads, " + GetParam().fault + "}\n", GetParam().answer_timeout};
  cell.run_until(0.9);
  EXPECT_FALSE(cell.step());
  EXPECT_EQ(cell.valve.counters().*GetParam().counter, 1U);
  EXPECT_EQ(cell.bus.counters().losses, 1U);
  EXPECT_FALSE(cell.valve.is_online());
  EXPECT_TRUE(cell.step());
  EXPECT_TRUE(cell.valve.is_online());
  EXPECT_EQ(cell.bus.counters().connects, 2U);
}

INSTANTIATE_TEST_SUITE_P(Bus, FaultOnARead,
                         ::testing::Values(Expected{"do: drop", &DeviceCounters::resets},
                                           Expected{"do: lose_answer", &DeviceCounters::resets},
                                           Expected{"do: garbage", &DeviceCounters::malformed},
                                           Expected{"do: cut_short", &DeviceCounters::short_answers,
                                                    Duration::milliseconds(500)}));

TEST(Faults, AnExceptionIsCountedByItsCodeAndLeavesTheLinkAlone) {
  Cell cell{"  - {at: 0.9, for: 0.05, do: exception, code: 6, register: flow}\n"};
  cell.run_until(0.9);
  EXPECT_FALSE(cell.step());
  EXPECT_EQ(cell.valve.counters().exceptions[6], 1U);
  EXPECT_EQ(cell.bus.counters().losses, 0U);
  EXPECT_EQ(cell.valve.value("setting").age.ns, 0);
  EXPECT_EQ(cell.valve.value("flow").age, Duration::milliseconds(100));
  EXPECT_TRUE(cell.step());
}

TEST(Faults, ALateAnswerIsDroppedOnTheSameConnection) {
  Cell cell{"  - {at: 0.9, for: 0.05, on: reads, do: delay, by: 3}\n", Duration::milliseconds(2000)};
  cell.run_until(0.9);
  EXPECT_FALSE(cell.step());
  EXPECT_EQ(cell.valve.counters().timeouts, 1U);
  EXPECT_FALSE(cell.valve.is_online());
  cell.step();
  EXPECT_TRUE(cell.step());
  EXPECT_NEAR(cell.valve.value("flow").value, cell.now.in_seconds(), 1e-6);
  EXPECT_EQ(cell.bus.counters().late, 1U);
  EXPECT_EQ(cell.bus.counters().losses, 0U);
  EXPECT_EQ(cell.bus.counters().connects, 1U);
}

TEST(Faults, ADelayWithinTheTimeoutIsNoFault) {
  Cell cell{"  - {at: 0, for: 10, do: delay, by: 0.02, on: reads}\n"};
  EXPECT_TRUE(cell.step());
  EXPECT_TRUE(cell.step());
  EXPECT_EQ(cell.valve.counters().timeouts, 0U);
}

TEST(Faults, AFrozenRegisterStandsStillAndTheOthersGoOn) {
  Cell cell{"  - {at: 0.9, for: 1, do: freeze, register: flow}\n"};
  cell.run_until(1.5);
  EXPECT_NEAR(cell.valve.value("flow").value, 0.9, 1e-6);
  EXPECT_FALSE(cell.valve.value("flow").stale);  // its answers are fresh: only the device knows
  cell.run_until(2.5);
  EXPECT_NEAR(cell.valve.value("flow").value, 2.5, 1e-6);
}

TEST(Faults, ValuesAgeWhileTheDeviceIsGoneAndAreStaleAfterWhatTheMapSays) {
  Cell cell{"  - {at: 0.9, for: 2, do: refuse}\n"};
  cell.run_until(0.9);
  for (int i = 1; i <= 10; ++i) {
    cell.step();
    const Reading flow = cell.valve.value("flow");
    EXPECT_EQ(flow.age, Duration::milliseconds(100 * i));
    EXPECT_EQ(flow.stale, i > 5) << i;
    EXPECT_NEAR(flow.value, 0.9, 1e-6);
    EXPECT_FALSE(cell.bus.is_connected());
  }
  cell.run_until(6.0);
  EXPECT_FALSE(cell.valve.value("flow").stale);
}

TEST(Faults, ARefusingDeviceIsTriedEverMoreSeldom) {
  Cell cell{"  - {at: 0.9, for: 30, do: refuse}\n"};
  cell.run_until(1.0);
  EXPECT_EQ(cell.bus.counters().losses, 1U);
  std::vector<double> tried;
  for (std::uint64_t seen = 0; cell.now < Instant{} + Duration::seconds(25);) {
    cell.step();
    if (cell.bus.counters().refused == seen) continue;
    seen = cell.bus.counters().refused;
    tried.push_back(cell.now.in_seconds());
  }
  // 0.1 s after the loss, then 0.1, 0.2, 0.4, ... 3.2, and from there every 5 s.
  EXPECT_THAT(tried, ::testing::Pointwise(::testing::DoubleNear(1e-9),
                                          {1.1, 1.2, 1.4, 1.8, 2.6, 4.2, 7.4, 12.4, 17.4, 22.4}));
}

TEST(Faults, AWriteThatCouldNotBeSentInTimeIsDroppedAndSaidSo) {
  Cell cell{"  - {at: 0.9, for: 2, do: refuse}\n"};
  cell.run_until(1.0);
  (void)cell.valve.write("setting", 7);
  cell.step();
  EXPECT_EQ(cell.valve.last_write("setting").state, WriteState::queued);
  cell.run_until(2.5);
  EXPECT_EQ(cell.valve.last_write("setting").state, WriteState::expired);
  cell.run_until(8.0);
  EXPECT_EQ(cell.server.value("setting"), 0.0);
  EXPECT_EQ(cell.server.counters().writes, 0U);
  EXPECT_EQ(cell.valve.counters().writes_expired, 1U);
}

TEST(Faults, AWriteThatWaitsIsSentOnceWhenTheDeviceIsBack) {
  Cell cell{"  - {at: 0.9, for: 0.4, do: refuse}\n"};
  cell.run_until(1.0);
  (void)cell.valve.write("setting", 7);
  (void)cell.valve.write("setting", 8);
  cell.run_until(3.0);
  EXPECT_EQ(cell.valve.last_write("setting").state, WriteState::confirmed);
  EXPECT_EQ(cell.valve.last_write("setting").number, 2U);
  EXPECT_EQ(cell.server.value("setting"), 8.0);
  EXPECT_EQ(cell.server.counters().writes, 1U);
  EXPECT_EQ(cell.valve.counters().writes_superseded, 1U);
}

TEST(Faults, ARefusedWriteIsNotRepeated) {
  Cell cell{"  - {at: 0.9, for: 0.05, do: exception, code: 4, on: writes}\n"};
  cell.run_until(0.9);
  (void)cell.valve.write("setting", 7);
  cell.run_until(2.0);
  EXPECT_EQ(cell.valve.last_write("setting").state, WriteState::refused);
  EXPECT_EQ(cell.valve.last_write("setting").exception, 4);
  EXPECT_EQ(cell.server.counters().writes, 0U);
}

// Under any fault on writes the device carries out each write at most once.
TEST(Faults, NoFaultMakesTheClientRepeatAWrite) {
  for (const std::string fault : {"drop", "lose_answer", "delay, by: 3", "garbage", "cut_short"}) {
    Cell cell{"  - {at: 0.9, for: 0.35, on: writes, do: " + fault + "}\n",
              Duration::milliseconds(fault.starts_with("delay") || fault == "cut_short" ? 300 : 20'000)};
    cell.run_until(0.9);
    (void)cell.valve.write("setting", 7);
    cell.run_until(4.0);
    const bool carried_out = fault != "drop";
    EXPECT_EQ(cell.server.counters().writes, carried_out ? 1U : 0U) << fault;
    EXPECT_EQ(cell.valve.counters().writes, 1U) << fault;
    EXPECT_EQ(cell.valve.last_write("setting").state, carried_out ? WriteState::confirmed : WriteState::lost)
        << fault << ": " << name_of(cell.valve.last_write("setting").state);
  }
}

TEST(Faults, AnEchoThatFollowsLaterConfirmsAndOneThatStaysAwayIsAMismatch) {
  Cell cell{"  - {at: 90, for: 1, do: drop}\n"};
  cell.lives = true;
  cell.run_until(1.0);
  (void)cell.valve.write("opening", 40);
  cell.step();
  EXPECT_EQ(cell.valve.last_write("opening").state, WriteState::written);
  cell.run_until(1.5);
  EXPECT_EQ(cell.valve.last_write("opening").state, WriteState::confirmed);
  cell.is_stuck = true;
  (void)cell.valve.write("opening", 60);
  cell.run_until(3.0);
  EXPECT_EQ(cell.valve.last_write("opening").state, WriteState::mismatched);
  EXPECT_EQ(cell.valve.counters().read_back_mismatches, 1U);
}

TEST(Faults, AnEchoThatStaysAwayIsAMismatchAlsoWhereTheWriteIsRepeated) {
  Cell cell{"  - {at: 90, for: 1, do: drop}\n"};
  cell.lives = true;
  cell.run_until(1.0);
  cell.is_stuck = true;
  while (cell.now < Instant{} + Duration::seconds(3)) {
    (void)cell.valve.write("opening", 60);
    cell.step();
  }
  EXPECT_EQ(cell.valve.last_write("opening").state, WriteState::mismatched);
  cell.is_stuck = false;
  for (int i = 0; i < 3; ++i) cell.step();
  (void)cell.valve.write("opening", 60);
  cell.step();
  EXPECT_EQ(cell.valve.last_write("opening").state, WriteState::confirmed);
}

TEST(Faults, SendBringsWhatWasComputedFromThisStepsReadingsIntoThisStep) {
  Cell cell{"  - {at: 90, for: 1, do: drop}\n"};
  cell.lives = true;
  cell.run_until(1.0);
  cell.step();
  (void)cell.valve.write("opening", 33);
  EXPECT_TRUE(cell.bus.send(cell.now));
  cell.step();
  EXPECT_EQ(cell.server.value("opening"), 33.0);
}

}  // namespace
}  // namespace invar::modbus
