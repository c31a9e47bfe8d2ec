// The client against the simulated device, in simulated time: exchange, heartbeat, comm loss, faults.
#include "core/modbus/bus.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/modbus/server.hpp"

namespace invar::modbus {
namespace {

RegisterMap heater_map() { return load_map(INVAR_SOURCE_DIR "/deployment/maps/heater.yaml"); }

constexpr Instant at(double seconds) { return Instant{} + Duration::seconds(seconds); }

/// A heater and its master, stepped in turn every 100 ms of simulated time.
struct Cell {
  explicit Cell(const std::string& faults = "")
      : server{heater_map(),
               {.faults = faults.empty() ? FaultScript{}
                                         : parse_faults("invar_modbus_faults: 1\nfaults:\n" + faults,
                                                        "faults.yaml", heater_map())}},
        bus{{.port = server.port(), .answer_timeout = Duration::seconds(20)}},
        heater{bus.add(heater_map())} {}

  bool step(bool refresh = true) {
    now += Duration::milliseconds(100);
    server.exchange(now);
    if (refresh) heater.refresh();
    return bus.exchange(now);
  }

  Instant now;
  Server server;
  Bus bus;
  Device& heater;
};

TEST(Bus, ReadsWhatTheDeviceShowsInSi) {
  Cell cell;
  cell.server.set("slide_temperature", 30.125);
  cell.server.set("slide_resistance", 805.436);
  cell.server.set("pad_temperature", -1.5);
  cell.server.set("heating", 1);
  ASSERT_TRUE(cell.step());
  EXPECT_DOUBLE_EQ(cell.heater.value("slide_temperature").value, 30.125);
  EXPECT_NEAR(cell.heater.value("slide_resistance").value, 805.436, 5e-4);
  EXPECT_NEAR(cell.heater.value("pad_temperature").value, -1.5, 1e-9);
  EXPECT_EQ(cell.heater.value("heating").value, 1.0);
  EXPECT_EQ(cell.heater.value("ready").value, 0.0);
  EXPECT_DOUBLE_EQ(cell.heater.value("watchdog_timeout").value, 1.0);  // 1000 ms on the wire
  EXPECT_FALSE(cell.heater.value("heating").stale);
  EXPECT_EQ(cell.heater.value("heating").age.ns, 0);
}

TEST(Bus, AValueOutsideItsRangeSaysSoAndIsCounted) {
  Cell cell;
  cell.server.set("slide_resistance", 1e6);
  cell.server.set("delivered_power", 200.0);
  cell.server.set("slide_temperature", 300.0);
  ASSERT_TRUE(cell.step());
  for (const char* reg : {"slide_resistance", "delivered_power", "slide_temperature"})
    EXPECT_TRUE(cell.heater.value(reg).is_sound()) << reg;  // on the bound
  EXPECT_EQ(cell.heater.counters().values_out_of_range, 0U);
  cell.server.set("slide_resistance", 1.001e6);
  cell.server.set("delivered_power", 200.02);
  cell.server.set("slide_temperature", std::nan(""));
  ASSERT_TRUE(cell.step());
  for (const char* reg : {"slide_resistance", "delivered_power", "slide_temperature"}) {
    EXPECT_FALSE(cell.heater.value(reg).stale) << reg;
    EXPECT_TRUE(cell.heater.value(reg).out_of_range) << reg;
    EXPECT_FALSE(cell.heater.value(reg).is_sound()) << reg;
  }
  EXPECT_EQ(cell.heater.counters().values_out_of_range, 3U);
  EXPECT_TRUE(cell.heater.value("pad_temperature").is_sound());
}

TEST(Bus, IsStaleAndNotANumberBeforeTheFirstAnswer) {
  Cell cell;
  EXPECT_TRUE(cell.heater.value("power").stale);
  EXPECT_TRUE(std::isnan(cell.heater.value("power").value));
}

TEST(Bus, ConfirmsAWriteByItsReadBackAndTheDeviceGetsItInItsNextStep) {
  Cell cell;
  cell.step();  // the first heartbeat
  ASSERT_TRUE(cell.heater.write("power", 12.34).ok());
  ASSERT_TRUE(cell.step());
  EXPECT_EQ(cell.heater.last_write("power").state, WriteState::confirmed);
  EXPECT_EQ(cell.server.value("power"), 0.0);
  cell.step();
  EXPECT_NEAR(cell.server.value("power"), 12.34, 1e-9);
  EXPECT_TRUE(cell.server.was_written("power"));
  cell.step();
  EXPECT_FALSE(cell.server.was_written("power"));
}

TEST(Bus, RefusesAValueOutsideItsRange) {
  Cell cell;
  EXPECT_EQ(cell.heater.write("power", 201).error(), WriteRefusal::out_of_range);
  EXPECT_EQ(cell.heater.write("power", std::nan("")).error(), WriteRefusal::out_of_range);
}

TEST(Bus, DeviceSwitchesOffWhenItsOwnerNoLongerRefreshes) {
  Cell cell;
  cell.step();
  (void)cell.heater.write("power", 50);
  (void)cell.heater.write("enable", 1);
  for (int i = 0; i < 30; ++i) cell.step();
  EXPECT_EQ(cell.server.value("power"), 50.0);
  EXPECT_FALSE(cell.server.comm_lost());
  const Instant died = cell.now;
  while (!cell.server.comm_lost() && cell.now < died + Duration::seconds(10)) cell.step(false);
  // The heartbeat goes on for refresh_within after the last refresh, then the device waits for its timeout.
  EXPECT_LE((cell.now - died).in_seconds(), 0.5 + 1.0 + 0.2 + 0.1);
  EXPECT_GE((cell.now - died).in_seconds(), 1.0);
  EXPECT_EQ(cell.server.value("power"), 0.0);
  EXPECT_EQ(cell.server.value("enable"), 0.0);
  cell.step(false);
  EXPECT_EQ(cell.heater.value("comm_lost").value, 1.0);
  EXPECT_EQ(cell.heater.value("power").value, 0.0);
  for (int i = 0; i < 5; ++i) cell.step();  // its owner is back: the device listens again, but stays off
  EXPECT_FALSE(cell.server.comm_lost());
  EXPECT_EQ(cell.server.value("power"), 0.0);
}

TEST(Bus, NeverRepeatsAWriteWhoseAnswerWasLostAndFindsOutByReadBack) {
  Cell cell{"  - {at: 1, for: 0.15, do: lose_answer, on: writes}\n"};
  while (cell.now < at(1.0)) cell.step(false);  // no heartbeat: the only write is ours
  (void)cell.heater.write("over_temperature_limit", 60);
  EXPECT_FALSE(cell.step(false));
  EXPECT_EQ(cell.heater.last_write("over_temperature_limit").state, WriteState::uncertain);
  EXPECT_EQ(cell.heater.counters().resets, 1U);
  for (int i = 0; i < 10; ++i) cell.step(false);
  EXPECT_EQ(cell.heater.last_write("over_temperature_limit").state, WriteState::confirmed);
  EXPECT_EQ(cell.server.value("over_temperature_limit"), 60.0);
  EXPECT_EQ(cell.server.counters().writes, 1U);
}

TEST(Bus, SaysThatAWriteIsLostWhenTheReadBackDoesNotShowIt) {
  Cell cell{"  - {at: 1, for: 0.15, do: drop, on: writes}\n"};
  while (cell.now < at(1.0)) cell.step(false);
  (void)cell.heater.write("over_temperature_limit", 60);
  for (int i = 0; i < 10; ++i) cell.step(false);
  EXPECT_EQ(cell.heater.last_write("over_temperature_limit").state, WriteState::lost);
  EXPECT_EQ(cell.server.counters().writes, 0U);
  EXPECT_EQ(cell.heater.counters().writes, 1U);
}

TEST(Bus, TwoRunsOfTheSameCellGiveTheSameValuesBitForBit) {
  const auto run = [] {
    Cell cell{"  - {at: 2, for: 0.5, do: drop}\n  - {at: 4, for: 1, do: refuse}\n"};
    std::vector<double> trace;
    double temperature = 20.0;
    for (int i = 0; i < 100; ++i) {
      temperature += 0.1 * (0.02 * cell.server.value("power") - 0.01 * (temperature - 20.0));
      cell.server.set("slide_temperature", temperature);
      cell.step();
      const auto seen = cell.heater.value("slide_temperature");
      if (!seen.stale) (void)cell.heater.write("power", std::clamp(20.0 * (30.0 - seen.value), 0.0, 200.0));
      trace.insert(trace.end(), {seen.value, seen.age.in_seconds(), seen.stale ? 1.0 : 0.0, temperature});
    }
    return trace;
  };
  const auto first = run();
  const auto second = run();
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_TRUE(first[i] == second[i] || (std::isnan(first[i]) && std::isnan(second[i]))) << i;
}

}  // namespace
}  // namespace invar::modbus
