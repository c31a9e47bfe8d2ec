// The temperature loop on the simulated heater over real Modbus TCP, in simulated time.
#include "components/thermal/thermal.hpp"

#include <gmock/gmock.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/base/fault.hpp"
#include "tests/support/changed_map.hpp"
#include "tests/support/heat_bench.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::thermal {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Bench = HeatBench;

TEST(Thermal, BringsTheSlideToItsSetpointAndHoldsIt) {
  Bench bench;
  bench.bring_up();
  double highest = 0.0;
  for (int i = 0; i < 12'000; ++i) highest = std::max(highest, bench.cycle_once().heater_power());
  EXPECT_LE(highest, 120.0);
  for (int i = 0; i < 3'000; ++i) ASSERT_NEAR(bench.cycle_once().temperature(), 30.0, 0.02);
}

TEST(Thermal, PublishesFurtherZonesFromTheirThermistors) {
  Bench bench;
  bench.bring_up();
  const NodeTemperature slide = bench.run_for(600.0);
  EXPECT_FALSE(bench.base.latest()->stale());
  EXPECT_NEAR(bench.base.latest()->temperature(), bench.true_base.latest()->temperature(), 2e-3);
  EXPECT_GT(bench.base.latest()->temperature(), 23.2);
  EXPECT_LT(bench.base.latest()->temperature(), slide.temperature() - 1.0);
}

TEST(Thermal, TwoRunsAgreeBitForBit) {
  const invar::testing::TemporaryFolder folder;
  const auto script = folder.write("faults.yaml",
                                   "invar_modbus_faults: 1\nfaults:\n"
                                   "  - {at: 20, for: 5, do: drop}\n  - {at: 40, for: 3, do: refuse}\n");
  const auto run = [&] {
    Bench bench{script};
    bench.heater_parameters.noise = 0.003;
    bench.bring_up();
    std::vector<std::uint64_t> trace;  // bits, since what is not measured yet is no number
    for (int i = 0; i < 800; ++i) {
      const NodeTemperature& state = bench.cycle_once();
      for (const double value : {state.temperature(), state.heater_power(), state.stale() ? 1.0 : 0.0})
        trace.push_back(std::bit_cast<std::uint64_t>(value));
    }
    return trace;
  };
  EXPECT_EQ(run(), run());
}

TEST(Thermal, LetsGoOfTheHeaterWhileItsDeviceIsGoneAndGoesOnWhenItIsBack) {
  const invar::testing::TemporaryFolder folder;
  const auto script = folder.write("faults.yaml",
                                   "invar_modbus_faults: 1\nfaults:\n"
                                   "  - {at: 60, for: 20, do: refuse}\n");
  Bench bench{script};
  bench.bring_up();
  EXPECT_TRUE(bench.run_for(60.0).enabled());
  const NodeTemperature gone = bench.run_for(10.0);
  EXPECT_TRUE(gone.stale());
  EXPECT_FALSE(gone.enabled());
  EXPECT_EQ(gone.heater_power(), 0.0);
  const NodeTemperature back = bench.run_for(1200.0);
  EXPECT_FALSE(back.stale());
  EXPECT_NEAR(back.temperature(), 30.0, 0.05);
}

TEST(Thermal, DeviceSwitchesOffByItselfWhenTheLoopNoLongerRuns) {
  Bench bench;
  bench.bring_up();
  const NodeTemperature last = bench.run_for(60.0);
  EXPECT_GT(last.heater_power(), 50.0);
  for (int i = 0; i < 30; ++i) bench.cycle_once(false);
  EXPECT_EQ(bench.heater_power(), 0.0);
  EXPECT_TRUE(bench.cycle_once().watchdog_tripped());
  EXPECT_NEAR(bench.run_for(1200.0).temperature(), 30.0, 0.05);
}

TEST(Thermal, SetsTheWatchdogOfADeviceThatWouldWaitLonger) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.thermal_parameters.modbus.map = bench.heater_parameters.modbus.map = test::changed_map(
      folder, "heater.yaml", {{"range: [100, 10000], initial: 1000", "range: [100, 10000], initial: 10000"}});
  bench.bring_up();
  EXPECT_GT(bench.run_for(60.0).heater_power(), 50.0);
  for (int i = 0; i < 30; ++i) bench.cycle_once(false);
  EXPECT_EQ(bench.heater_power(), 0.0);
}

TEST(Thermal, LatchesAtOverTemperatureUntilItIsReset) {
  Bench bench;
  bench.thermal_parameters.over_temperature = 26.0;
  bench.thermal_parameters.setpoint = 25.5;
  bench.thermal_parameters.pid.ki = 5.0;  // a bad tuning that overshoots
  bench.bring_up();
  NodeTemperature state;
  for (int i = 0; i < 6000 && !state.over_temperature(); ++i) state = bench.cycle_once();
  ASSERT_TRUE(state.over_temperature());
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("degC is above `over_temperature`")));
  state = bench.run_for(600.0);
  EXPECT_TRUE(state.over_temperature());
  EXPECT_EQ(state.heater_power(), 0.0);
  bench.send_reset(24.0);
  EXPECT_FALSE(bench.cycle_once().over_temperature());
}

TEST(Thermal, DeviceThatLatchesAtItsOwnLimitIsSaidAndResetWithTheLoopsLatch) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.thermal_parameters.modbus.map = bench.heater_parameters.modbus.map = test::changed_map(
      folder, "heater.yaml", {{"range: [0, 150], initial: 80", "range: [0, 150], initial: 26"}});
  bench.bring_up();
  NodeTemperature state;
  for (int i = 0; i < 600 && !state.over_temperature(); ++i) state = bench.cycle_once();
  ASSERT_TRUE(state.over_temperature());
  EXPECT_LT(state.temperature(), 26.0);  // the pad is hotter than the slide
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("switched the heater off at its own limit")));
  for (int i = 0; i < 6000; ++i) ASSERT_FALSE(bench.cycle_once().enabled()) << i;
  EXPECT_THAT(bench.said(), IsEmpty());
  bench.send_reset(30.0);
  double power = 0.0;
  for (int i = 0; i < 20 && power == 0.0; ++i) {
    bench.cycle_once();
    power = bench.heater_power();
  }
  EXPECT_GT(power, 1.0);
}

TEST(Thermal, HeaterThatStaysOnThoughItWasToldToBeOffIsSaidOnce) {
  const invar::testing::TemporaryFolder folder;
  Bench bench{folder.write("faults.yaml",
                           "invar_modbus_faults: 1\nfaults:\n"
                           "  - {at: 9, for: 40, do: freeze, register: delivered_power}\n")};
  bench.bring_up();
  EXPECT_TRUE(bench.run_for(10.0).enabled());
  EXPECT_THAT(bench.said(), IsEmpty());
  bench.ask(30.0, false);
  bench.run_for(1.5);
  EXPECT_THAT(bench.said(), IsEmpty());
  bench.run_for(20.0);
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("W though it was told to be off: cut its supply")));
  bench.run_for(20.0);
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("the heater is off as it was told")));
}

TEST(Thermal, FullPowerThatDoesNotShowInTheTemperatureLatches) {
  const invar::testing::TemporaryFolder folder;
  Bench bench{folder.write("faults.yaml",
                           "invar_modbus_faults: 1\nfaults:\n"
                           "  - {at: 20, for: 100000, do: freeze, register: slide_resistance}\n")};
  bench.thermal_parameters.response.within = 60.0;
  bench.bring_up();
  double full = 0.0;  // seconds at full power since the reading stands still
  NodeTemperature state;
  for (int i = 0; i < 12000 && !state.over_temperature(); ++i) {
    state = bench.cycle_once();
    if (i > 200) full = state.heater_power() >= 120.0 ? full + Bench::period : 0.0;
  }
  ASSERT_TRUE(state.over_temperature());
  EXPECT_LE(full, 60.1);
  EXPECT_GE(full, 55.0);  // the half kelvin before the freeze may have been some seconds old
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("the heat of 120 W for 60 s, given in 60 s, has not")));
  EXPECT_FALSE(bench.run_for(5.0).enabled());
  EXPECT_EQ(bench.heater_power(), 0.0);
  bench.send_reset();
  EXPECT_TRUE(bench.run_for(5.0).enabled());  // and tries anew
  EXPECT_THAT(bench.said(), IsEmpty());
}

TEST(Thermal, CommandWhoseSetpointCannotBeIsRefusedAndTheLoopGoesOn) {
  Bench bench;
  bench.bring_up();
  bench.run_for(1200.0);
  EXPECT_THAT(bench.said(), IsEmpty());
  for (const double wrong : {std::nan(""), HUGE_VAL, 1e3, -300.0, 60.0}) {  // the latch stands at 60
    bench.ask(wrong);
    const NodeTemperature state = bench.run_for(60.0);
    EXPECT_EQ(state.setpoint(), 30.0) << wrong;
    EXPECT_TRUE(state.enabled());
    EXPECT_NEAR(state.temperature(), 30.0, 0.05) << wrong;
    EXPECT_NEAR(bench.heater_power(), state.heater_power(), 0.5);
    EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("is refused")));
  }
  bench.ask(std::nan(""), false);  // off is off, whatever stands beside it
  EXPECT_FALSE(bench.run_for(1.0).enabled());
  EXPECT_EQ(bench.heater_power(), 0.0);
  bench.ask(std::nan(""), true);
  EXPECT_FALSE(bench.run_for(1.0).enabled());
}

TEST(Thermal, PowerThatIsNoNumberSwitchesTheHeaterOff) {
  Bench bench;
  bench.bring_up();
  EXPECT_GT(bench.run_for(10.0).heater_power(), 50.0);
  bench.ask(30.0, false);
  bench.cycle_once();
  bench.ask(30.0, true);
  const Tick tick{bench.at(), 0.0, bench.cycle++};  // a cycle of no length: the slope is 0/0
  bench.heater->step(tick);
  bench.thermal->step(tick);
  EXPECT_FALSE(bench.state.latest()->enabled());
  EXPECT_EQ(bench.state.latest()->heater_power(), 0.0);
  bench.heater->step(Tick{bench.at(), Bench::period, bench.cycle});
  EXPECT_EQ(bench.heater_power(), 0.0);
  EXPECT_THAT(bench.said(), Contains(HasSubstr("no power that the heater takes")));
  EXPECT_GT(bench.run_for(1.0).heater_power(), 50.0);
}

// Each of these showed a temperature far below zero and gave full power.
TEST(Thermal, SensorThatCannotBeLetsGoOfTheHeaterAndIsSaidOnce) {
  const std::pair<std::string, std::string> swapped{
      "type: uint32, scale: 0.001, unit: ohm", "type: uint32, word_order: cdab, scale: 0.001, unit: ohm"};
  const std::pair<std::string, std::string> narrow{"range: [0, 1000000]", "range: [0, 500]"};
  const std::vector<std::pair<std::string, std::string>> faulty{
      {"bit: 0", "bit: 3"},
      {"bit: 3, kind: input, type: bool, access: read, description: A",
       "bit: 0, kind: input, type: bool, access: read, description: A"}};
  const invar::testing::TemporaryFolder folder;
  const auto check = [](Bench& bench, const char* text) {
    bench.bring_up();
    for (int i = 0; i < 300; ++i) {
      const NodeTemperature& state = bench.cycle_once();
      ASSERT_TRUE(state.stale()) << text << ", cycle " << i;
      ASSERT_FALSE(state.enabled());
      ASSERT_EQ(state.heater_power(), 0.0);
    }
    EXPECT_EQ(bench.heater_power(), 0.0);
    EXPECT_THAT(bench.said(), ElementsAre(HasSubstr(text)));
  };
  {
    Bench bench;
    bench.thermal_parameters.modbus.map = test::changed_map(folder, "heater.yaml", {swapped});
    check(bench, "outside its range");
  }
  {
    Bench bench;
    bench.thermal_parameters.modbus.map = test::changed_map(folder, "heater.yaml", {narrow});
    check(bench, "outside its range");
  }
  {
    Bench bench;  // the device's bit of a thermistor that is open or short
    bench.thermal_parameters.modbus.map = test::changed_map(folder, "heater.yaml", {faulty[0], faulty[1]});
    check(bench, "open or short");
  }
  {
    Bench bench;  // inside the map's range, but no temperature of a slide
    bench.thermal_parameters.thermistor.resistance = 20.0;
    check(bench, "open or short");
  }
}

TEST(Thermal, RefusesAMapThatCannotTakeItsPowerOrMeasuresSomethingElse) {
  const invar::testing::TemporaryFolder folder;
  const auto fault = [&](std::initializer_list<std::pair<std::string, std::string>> changes,
                         double limit = 120.0) {
    Thermal::Parameters parameters;
    parameters.modbus.map = test::changed_map(folder, "heater.yaml", changes);
    parameters.power_limit = limit;
    try {
      const Thermal thermal{parameters};
    } catch (const InputError& error) {
      return std::string{error.what()};
    }
    return std::string{"(no fault)"};
  };
  EXPECT_EQ(fault({}), "(no fault)");
  EXPECT_THAT(fault({}, 500.0), AllOf(HasSubstr("power_limit: asks register `power` for 500 W"),
                                      HasSubstr("range is 0 to 200"), HasSubstr("stay inside")));
  EXPECT_THAT(fault({{"scale: 0.01, unit: W", "scale: 0.01, unit: m"}}),
              HasSubstr("register `power` is in `m`, and is needed in a unit like `W or %`"));
  EXPECT_EQ(fault({{"scale: 0.01, unit: W, range: [0, 200]", "scale: 10, unit: mW, range: [0, 200000]"}}),
            "(no fault)");
  EXPECT_THAT(fault({{"scale: 0.001, unit: ohm", "scale: 0.001, unit: V"}}), HasSubstr("`slide_resistance`"));
}

TEST(Thermal, RefusesAMapThatLeavesTheHeaterOnWhenItsMasterDies) {
  const invar::testing::TemporaryFolder folder;
  for (const char* action :
       {"  hold: [enable, power]", "  set: {enable: {value: 1, because: I like it warm}}\n  hold: [power]"}) {
    Thermal::Parameters parameters;
    parameters.modbus.map =
        test::changed_map(folder, "heater.yaml", {{"  set: {enable: 0, power: 0}", action}});
    try {
      const Thermal thermal{parameters};
      ADD_FAILURE() << action;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("does not switch the device off when its master is lost"))
          << action;
    }
  }
}

TEST(Thermal, ATemperatureThatItHasNotGotIsNone) {
  const invar::testing::TemporaryFolder folder;
  Bench bench{
      folder.write("faults.yaml", "invar_modbus_faults: 1\nfaults:\n  - {at: 0, for: 5, do: refuse}\n")};
  bench.bring_up();
  for (int i = 0; i < 45; ++i) {
    const NodeTemperature& state = bench.cycle_once();
    ASSERT_TRUE(std::isnan(state.temperature())) << i;
    ASSERT_TRUE(std::isnan(bench.base.latest()->temperature())) << i;
    ASSERT_TRUE(state.stale());
    ASSERT_FALSE(state.enabled());
  }
  const NodeTemperature sound = bench.run_for(30.0);
  EXPECT_FALSE(sound.stale());
  EXPECT_GT(sound.temperature(), 15.0);
}

TEST(Thermal, DeviceThatRefusesWritesIsLetGoAndSaidOnceAndOnceAgainWhenItTakesThem) {
  const invar::testing::TemporaryFolder folder;
  const auto script =
      folder.write("faults.yaml",
                   "invar_modbus_faults: 1\nfaults:\n"
                   "  - {at: 60, for: 5, do: exception, code: 4, on: writes, register: power}\n");
  Bench bench{script};
  bench.bring_up();
  EXPECT_TRUE(bench.run_for(60.0).enabled());
  EXPECT_THAT(bench.said(), IsEmpty());
  bench.run_for(0.5);
  for (int i = 0; i < 40; ++i) {
    const NodeTemperature& state = bench.cycle_once();
    EXPECT_FALSE(state.enabled());
    EXPECT_EQ(state.heater_power(), 0.0);
  }
  EXPECT_EQ(bench.heater_power(), 0.0);
  EXPECT_THAT(bench.said(), ElementsAre(AllOf(HasSubstr("`power`"), HasSubstr("exception 4"))));
  EXPECT_TRUE(bench.run_for(30.0).enabled());
  EXPECT_GT(bench.heater_power(), 1.0);
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("takes writes again")));
}

TEST(Thermal, DeviceThatIsLostIsSaidOnceAndOnceAgainWhenItIsBack) {
  const invar::testing::TemporaryFolder folder;
  const auto script =
      folder.write("faults.yaml", "invar_modbus_faults: 1\nfaults:\n  - {at: 10, for: 20, do: refuse}\n");
  Bench bench{script};
  bench.bring_up();
  bench.run_for(25.0);
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("does not answer")));
  bench.run_for(25.0);
  EXPECT_THAT(bench.said(), ElementsAre(HasSubstr("answers again")));
}

/// A controller of another make: degrees instead of ohm, power in percent, no relay of its own and no alarms.
constexpr const char* plain_map =
    "invar_modbus_map: 1\n"
    "device: controller\n"
    "poll: {value: 100, unit: ms}\n"
    "timeouts: {stale: 0.5}\n"
    "heartbeat: {register: life, timeout: 1}\n"
    "comm_loss: {set: {power: 0}}\n"
    "registers:\n"
    "  power: {address: 0, kind: holding, type: uint16, scale: 0.1, unit: \"%\", range: [0, 100], access: "
    "read_write,\n"
    "          role: actuator, read_back: self}\n"
    "  life: {address: 1, kind: holding, type: uint16, access: read_write, role: setting}\n"
    "  slide_temperature: {address: 2, kind: input, type: int16, scale: 0.1, unit: degF, access: read}\n"
    "  base_temperature: {address: 3, kind: input, type: int16, scale: 0.1, unit: degF, access: read}\n";

TEST(Thermal, HeatsByAControllerThatReportsDegreesAndTakesPercentAndHasNoEnable) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.thermal_parameters.modbus.map = bench.heater_parameters.modbus.map =
      folder.write("plain.yaml", plain_map);
  bench.thermal_parameters.rated_power = bench.heater_parameters.rated_power = 120.0;
  bench.bring_up();
  EXPECT_EQ(bench.run_for(10.0).heater_power(), 120.0);
  const NodeTemperature state = bench.run_for(1200.0);
  EXPECT_NEAR(state.temperature(), 30.0, 0.1);
  EXPECT_FALSE(state.watchdog_tripped());
  EXPECT_NEAR(bench.base.latest()->temperature(), bench.true_base.latest()->temperature(), 0.06);
  EXPECT_THAT(bench.said(), IsEmpty());
  bench.ask(30.0, false);  // off without a relay: the power is 0
  EXPECT_LT(bench.run_for(600.0).temperature(), 29.0);
}

TEST(Thermal, TellsAllThatAMapLacks) {
  const invar::testing::TemporaryFolder folder;
  Thermal::Parameters parameters;
  parameters.zones = {{"nozzle", {}}};
  parameters.modbus.map = folder.write("bare.yaml",
                                       "invar_modbus_map: 1\ndevice: bare\nregisters:\n"
                                       "  enable: {address: 0, kind: coil, type: bool, access: read}\n"
                                       "  delivered_power: {address: 0, kind: input, type: uint16, unit: "
                                       "V, access: read}\n");
  try {
    const Thermal thermal{parameters};
    FAIL() << "accepted";
  } catch (const InputError& error) {
    std::string lines;
    for (const Fault& fault : error.faults()) lines += fault.line() + "\n";
    EXPECT_THAT(lines, HasSubstr("has no register `power` [W or %], `slide_resistance` [ohm] or "
                                 "`slide_temperature` [degC], `nozzle_resistance` [ohm] or "
                                 "`nozzle_temperature` [degC]; add"));
    EXPECT_THAT(lines, HasSubstr("register `enable` cannot be written"));
    EXPECT_THAT(lines, HasSubstr("register `delivered_power` is in `V`"));
    EXPECT_THAT(lines, HasSubstr("does not switch the device off"));
  }
  parameters.zones.clear();
  parameters.modbus.map = folder.write("plain.yaml", plain_map);
  try {
    const Thermal thermal{parameters};
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("rated_power: missing, and the map counts power in parts of it"));
  }
}

}  // namespace
}  // namespace invar::thermal
