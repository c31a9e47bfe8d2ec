// The dispenser on the simulated pneumatic controller over real Modbus TCP, in simulated time; the valve hears its pressure.
#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/changed_map.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/dispenser/dispenser_bench.hpp"

namespace invar::dispenser {
namespace {

using namespace dispensing;
using Bench = testing::DispenserBench;

TEST(Dispenser, BringsThePressureIntoItsBandAndOnlyThenTheValveJets) {
  Bench bench;
  bench.bring_up();
  bench.cycle_once();
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE);
  // First order lag: in the band of 500 Pa after lag * ln(67200 / 500) = 0.735 s; registers come a step or two later.
  EXPECT_FALSE(bench.run_for(0.68).in_band());
  const PressureState state = bench.run_for(0.3);
  EXPECT_TRUE(state.in_band());
  EXPECT_NEAR(state.pressure(), 67.2e3, 400.0);
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, SupplyThatFallsStopsTheJettingUntilItIsBack) {
  Bench bench;
  bench.bring_up();
  bench.run_for(2.0);
  ASSERT_TRUE(bench.jets());
  bench.device_parameters.supply = 50e3;
  const PressureState low = bench.run_for(1.0);
  EXPECT_TRUE(low.supply_low());
  EXPECT_FALSE(low.in_band());
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE);
  bench.device_parameters.supply = 6e5;
  bench.run_for(2.0);
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, OverPressureLatchesAndVentsUntilItIsResetByHand) {
  Bench bench;
  bench.device_parameters.over_pressure = 1e5;
  bench.bring_up();
  bench.run_for(2.0);
  bench.device_parameters.leak_through = 6e4;  // the regulator is worn
  PressureState state = bench.run_for(1.0);
  EXPECT_TRUE(state.over_pressure());
  EXPECT_FALSE(state.enabled());
  EXPECT_FALSE(bench.jets());
  bench.device_parameters.leak_through = 0.0;
  state = bench.run_for(5.0);
  EXPECT_TRUE(state.over_pressure());
  EXPECT_LT(bench.actual.latest()->pressure(), 100.0);
  PressureCommand reset;
  reset.setpoint(67.2e3);
  reset.purge_setpoint(20e3);
  reset.enabled(true);
  reset.reset_alarms(true);
  bench.command.write(reset);
  state = bench.run_for(2.0);
  EXPECT_FALSE(state.over_pressure());
  EXPECT_TRUE(state.in_band());
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, ControllerThatDoesNotAnswerIsStaleAndNothingIsJetted) {
  invar::testing::TemporaryFolder folder;
  Bench bench{
      folder.write("faults.yaml", "invar_modbus_faults: 1\nfaults:\n  - {at: 3, for: 4, do: refuse}\n")};
  bench.bring_up();
  bench.run_for(2.9);
  ASSERT_TRUE(bench.jets());
  const PressureState gone = bench.run_for(0.6);
  EXPECT_TRUE(gone.stale());
  EXPECT_FALSE(gone.in_band());
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE_STALE);
  // The link is back, and with it the heartbeat.
  bench.run_for(8.0);
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, ControllerVentsByItselfWhenTheDispenserNoLongerRuns) {
  Bench bench;
  bench.bring_up();
  bench.run_for(2.0);
  EXPECT_GT(bench.actual.latest()->pressure(), 66e3);
  bench.run_for(0.7, false);  // the watchdog waits a second from the last heartbeat
  EXPECT_GT(bench.actual.latest()->pressure(), 66e3);
  bench.run_for(2.0, false);
  EXPECT_LT(bench.actual.latest()->pressure(), 100.0);
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE_STALE);
  EXPECT_TRUE(bench.cycle_once().comm_lost());
  bench.run_for(2.0);
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, SetsPressureAndPurgeByCommandAndNothingIsJettedBeforeTheNewBandIsReached) {
  Bench bench;
  bench.bring_up();
  PressureState state = bench.run_for(2.0);
  ASSERT_TRUE(bench.jets());
  EXPECT_FALSE(state.purging());
  EXPECT_LT(state.purge_pressure(), 100.0);
  PressureCommand command;
  command.setpoint(90e3);
  command.purge_setpoint(35e3);
  command.enabled(true);
  command.purge(true);
  bench.command.write(command);
  state = bench.cycle_once();
  EXPECT_EQ(state.setpoint(), 90e3);
  EXPECT_FALSE(state.in_band()) << "the controller still holds the band of the old setpoint";
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE);
  state = bench.run_for(2.0);
  EXPECT_NEAR(bench.actual.latest()->pressure(), 90e3, 500.0);
  EXPECT_NEAR(bench.actual.latest()->purge_pressure(), 35e3, 500.0);
  EXPECT_NEAR(state.purge_pressure(), 35e3, 500.0);
  EXPECT_TRUE(state.purging());
  EXPECT_TRUE(state.in_band());
  EXPECT_TRUE(bench.jets());
  // Setpoints of 0 stay as they are; the purge alone ends.
  command.setpoint(0.0);
  command.purge_setpoint(0.0);
  command.purge(false);
  bench.command.write(command);
  state = bench.run_for(2.0);
  EXPECT_FALSE(state.purging());
  EXPECT_LT(bench.actual.latest()->purge_pressure(), 100.0);
  EXPECT_NEAR(state.pressure(), 90e3, 500.0);
}

TEST(Dispenser, LosesPurgeAndPressureWithItsHeartbeat) {
  Bench bench;
  bench.bring_up();
  PressureCommand command;
  command.enabled(true);
  command.purge(true);
  bench.command.write(command);
  bench.run_for(2.0);
  EXPECT_TRUE(bench.actual.latest()->purging());
  bench.run_for(2.5, false);  // this process hangs
  EXPECT_TRUE(bench.actual.latest()->comm_lost());
  EXPECT_FALSE(bench.actual.latest()->purging());
  EXPECT_FALSE(bench.actual.latest()->enabled());
  EXPECT_LT(bench.actual.latest()->purge_pressure(), 100.0);
}

TEST(Dispenser, SensorFaultLatchesHereUntilItIsResetByHand) {
  Bench bench;
  bench.bring_up();
  bench.run_for(2.0);
  ASSERT_TRUE(bench.jets());
  bench.device_parameters.sensor_fault = true;
  PressureState state = bench.run_for(0.5);
  EXPECT_TRUE(state.sensor_fault());
  EXPECT_FALSE(state.enabled());
  EXPECT_FALSE(bench.jets());
  bench.device_parameters.sensor_fault = false;  // a loose contact
  state = bench.run_for(3.0);
  EXPECT_FALSE(state.sensor_fault());
  EXPECT_FALSE(bench.actual.latest()->enabled()) << "it came back by itself";
  EXPECT_FALSE(bench.jets());
  PressureCommand reset;
  reset.enabled(true);
  reset.reset_alarms(true);
  bench.command.write(reset);
  EXPECT_TRUE(bench.run_for(2.0).in_band());
  EXPECT_TRUE(bench.jets());
}

TEST(Dispenser, DeactivatedItShutsTheSupply) {
  Bench bench;
  bench.bring_up();
  bench.run_for(2.0);
  bench.dispenser->deactivate();
  bench.run_for(0.1, false);
  EXPECT_FALSE(bench.actual.latest()->enabled());
}

TEST(Dispenser, PressureThatCannotBeIsUnknownAndNothingIsPressurised) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.parameters.modbus.map = test::changed_map(
      folder, "pneumatic.yaml", {{"unit: kPa, range: [-100, 1000]", "unit: kPa, range: [10, 1000]"}});
  bench.bring_up();
  const PressureState state = bench.run_for(3.0);
  EXPECT_TRUE(state.stale());
  EXPECT_FALSE(state.in_band());
  EXPECT_LT(bench.actual.latest()->pressure(), 100.0);
  EXPECT_FALSE(bench.jets());
  EXPECT_EQ(bench.why(), REFUSED_PRESSURE_STALE);
  EXPECT_THAT(bench.said(),
              ::testing::ElementsAre(::testing::HasSubstr("`actual_pressure`, outside its range")));
}

TEST(Dispenser, ControllerThatRefusesWritesIsShutAndSaidOnceAndOnceAgainWhenItTakesThem) {
  const invar::testing::TemporaryFolder folder;
  Bench bench{folder.write("faults.yaml",
                           "invar_modbus_faults: 1\nfaults:\n"
                           "  - {at: 3, for: 4, do: exception, code: 2, on: writes, register: pressure}\n")};
  bench.bring_up();
  ASSERT_TRUE(bench.run_for(2.9).in_band());
  EXPECT_THAT(bench.said(), ::testing::IsEmpty());
  const PressureState refused = bench.run_for(1.0);
  EXPECT_FALSE(refused.enabled());
  EXPECT_FALSE(refused.in_band());
  EXPECT_FALSE(bench.actual.latest()->enabled());
  EXPECT_FALSE(bench.jets());
  EXPECT_THAT(bench.said(), ::testing::ElementsAre(::testing::HasSubstr("exception 2")));
  EXPECT_TRUE(bench.run_for(12.0).in_band());
  EXPECT_THAT(bench.said(), ::testing::ElementsAre(::testing::HasSubstr("takes writes again")));
}

TEST(Dispenser, RefusesAMapThatCannotTakeItsPressuresAndCommandsBeyondIt) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.parameters.modbus.map =
      test::changed_map(folder, "pneumatic.yaml", {{"range: [-20000, 700000]", "range: [-20000, 100000]"}});
  bench.bring_up();
  PressureCommand command;
  command.enabled(true);
  for (const double wrong : {2e5, std::nan("")}) {
    command.setpoint(wrong);
    bench.command.write(command);
    EXPECT_EQ(bench.cycle_once().setpoint(), 67.2e3);
    EXPECT_THAT(bench.said(), ::testing::ElementsAre(::testing::HasSubstr("is refused")));
  }
  bench.parameters.pressure = 2e5;
  try {
    const Dispenser dispenser{bench.parameters};
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("pressure: asks register `pressure` for 200000 Pa"));
  }
}

TEST(Dispenser, TwoRunsAgreeBitForBit) {
  invar::testing::TemporaryFolder folder;
  const auto script = folder.write(
      "faults.yaml",
      "invar_modbus_faults: 1\nfaults:\n  - {at: 2, for: 1, do: drop}\n  - {at: 4, for: 1, do: refuse}\n");
  const auto run = [&] {
    Bench bench{script};
    bench.bring_up();
    std::vector<double> trace;
    for (int i = 0; i < 400; ++i) {
      const PressureState& state = bench.cycle_once();
      trace.insert(trace.end(), {state.pressure(), state.in_band() ? 1.0 : 0.0, state.stale() ? 1.0 : 0.0});
    }
    return trace;
  };
  EXPECT_EQ(run(), run());
}

TEST(Dispenser, WorksWithAControllerThatHasNothingButAPressureAndItsReading) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.parameters.modbus.map = bench.device_parameters.modbus.map = folder.write(
      "plain.yaml",
      "invar_modbus_map: 1\n"
      "device: regulator\n"
      "poll: {value: 50, unit: ms}\n"
      "timeouts: {stale: 0.3}\n"
      "heartbeat: {register: life, timeout: 1}\n"
      "comm_loss: {set: {pressure: 0}}\n"
      "registers:\n"
      "  pressure: {address: 0, kind: holding, type: uint16, scale: 0.1, unit: kPa, access: read_write,\n"
      "             role: actuator, read_back: self}\n"
      "  life: {address: 1, kind: holding, type: uint16, access: read_write, role: setting}\n"
      "  actual_pressure: {address: 2, kind: input, type: uint16, scale: 0.1, unit: mbar, access: read}\n");
  bench.device_parameters.noise = 0.0;
  bench.bring_up();
  PressureState state = bench.run_for(2.0);
  EXPECT_TRUE(state.enabled());
  EXPECT_TRUE(state.in_band());
  EXPECT_NEAR(state.pressure(), 67.2e3, 100.0);
  EXPECT_TRUE(std::isnan(state.purge_pressure()));
  EXPECT_TRUE(bench.jets());
  PressureCommand command;
  command.enabled(true);
  command.purge(true);
  bench.command.write(command);
  EXPECT_FALSE(bench.run_for(0.5).purging());
  EXPECT_THAT(bench.said(), ::testing::ElementsAre(::testing::HasSubstr("has no `purge_pressure`")));
  command.enabled(false);
  command.purge(false);
  bench.command.write(command);
  state = bench.run_for(2.0);
  EXPECT_FALSE(state.enabled());
  EXPECT_FALSE(state.in_band());
  EXPECT_LT(state.pressure(), 500.0);  // off without a valve: the setpoint is 0
}

}  // namespace
}  // namespace invar::dispenser
