// The dispenser on the simulated pneumatic controller over real Modbus TCP, in simulated time; the valve hears its pressure.
#include "components/dispenser/dispenser.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "components/dispenser/valve.hpp"
#include "components/world/simulated_pneumatics.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "idl/event.h"
#include "tests/support/changed_map.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::dispenser {
namespace {

namespace fs = std::filesystem;
using namespace dispensing;

struct Bench final : Component {
  Output<PressureCommand> command{*this, "command"};
  Output<PatternCommand> print{*this, "print"};
  Output<compensation::ModelCommand> model{*this, "model"};
  Output<stage::AxisState> axis{*this, "axis"};
  Output<TriggerCommand> trigger{*this, "trigger"};
  Output<TriggerPattern> chase{*this, "chase"};
  Input<PressureState> pressure{*this, "pressure"};
  Input<PressureState> actual{*this, "actual"};
  Inbox<TriggerPattern> pattern{*this, "pattern"};
  Inbox<event::Notice> notices{*this, "notices", {}, 4096};
  Input<compensation::ModelStatus> status{*this, "status"};
  Inbox<DropletJetted> jetted{*this, "jetted", {}, 4096};
  Inbox<DropletRefused> refused{*this, "refused", {}, 4096};

  world::SimulatedPneumatics::Parameters device_parameters;
  Dispenser::Parameters parameters;
  Valve::Parameters valve_parameters;
  std::unique_ptr<world::SimulatedPneumatics> device;
  std::unique_ptr<Dispenser> dispenser;
  std::unique_ptr<Valve> valve;
  std::uint64_t cycle = 0;
  static constexpr double period = 0.02;

  explicit Bench(const fs::path& fault_script = {}) {
    const auto port = test::free_port();
    device_parameters.modbus.map = INVAR_SOURCE_DIR "/deployment/maps/pneumatic.yaml";
    device_parameters.modbus.port = port;
    device_parameters.modbus.faults = fault_script;
    parameters.modbus.map = device_parameters.modbus.map;
    parameters.modbus.port = port;
    parameters.pressurise = true;
    Pattern& grid = parameters.patterns.emplace_back();
    grid.name = "grid";
    grid.from = {0.06, 0.05};
    grid.pitch = {2e-3, 1e-3};
    grid.columns = 3;
    grid.rows = 2;
  }
  static InputPort& input_of(Component& component, const char* port) {
    return *static_cast<InputPort*>(component.find_port(port));
  }
  static OutputPort& output_of(Component& component, const char* port) {
    return *static_cast<OutputPort*>(component.find_port(port));
  }
  void bring_up() {
    device = std::make_unique<world::SimulatedPneumatics>(device_parameters);
    dispenser = std::make_unique<Dispenser>(parameters);
    valve = std::make_unique<Valve>(valve_parameters);
    for (Component* component : all()) {
      component->simulated_time = true;
      component->configure();
    }
    command.connect(input_of(*dispenser, "command"));
    print.connect(input_of(*dispenser, "print"));
    model.connect(input_of(*dispenser, "model"));
    output_of(*dispenser, "pressure").connect(pressure);
    output_of(*dispenser, "pressure").connect(input_of(*valve, "pressure"));
    output_of(*dispenser, "pattern").connect(pattern);
    output_of(*dispenser, "status").connect(status);
    output_of(*dispenser, "notices").connect(notices);
    output_of(*device, "actual").connect(actual);
    axis.connect(input_of(*valve, "state_x"));
    axis.connect(input_of(*valve, "state_y"));
    trigger.connect(input_of(*valve, "command"));
    chase.connect(input_of(*valve, "pattern"));
    output_of(*valve, "jetted").connect(jetted);
    output_of(*valve, "refused").connect(refused);
    for (Component* component : all()) component->activate();
  }
  std::vector<Component*> all() const { return {device.get(), dispenser.get(), valve.get()}; }
  void step(const Tick&) noexcept override {}

  [[nodiscard]] Instant at() const {
    return Instant{} + Duration::milliseconds(20) * static_cast<std::int64_t>(cycle);
  }
  const PressureState& cycle_once(bool owner_lives = true) {
    const Tick tick{at(), period, cycle++};
    set_now(tick.now);
    for (Component* component : all()) component->set_now(tick.now);
    device->step(tick);
    if (owner_lives) dispenser->step(tick);
    return *pressure.latest();
  }
  std::vector<std::string> said() {
    std::vector<std::string> texts;
    event::Notice notice;
    while (notices.take(notice)) texts.emplace_back(notice.text().c_str());
    return texts;
  }
  PressureState run_for(double seconds, bool owner_lives = true) {
    PressureState last;
    for (const Instant end = at() + Duration::seconds(seconds); at() < end;) last = cycle_once(owner_lives);
    return last;
  }
  /// Whether the valve jets now: a droplet by command over an armed pattern, on a stage that stands there.
  bool jets() {
    const Tick tick{at(), 1e-3, cycle};
    set_now(tick.now);
    valve->set_now(tick.now);
    stage::AxisState state;
    state.at().time_ns(tick.now.ns);
    state.enabled(true);
    state.homed(true);
    axis.write(state);
    TriggerPattern armed;
    armed.id(1);
    armed.points().resize(1);
    chase.write(armed);
    TriggerCommand arm;
    arm.pattern_id(1);
    arm.kind(TRIGGER_ARM);
    trigger.write(arm);
    arm.kind(TRIGGER_JET_NOW);
    trigger.write(arm);
    DropletJetted one;
    while (jetted.take(one)) {
    }
    valve->step(tick);
    return jetted.take(one);
  }
  RefusalReason why() {
    DropletRefused last;
    while (refused.take(last)) {
    }
    return last.reason();
  }
  TriggerPattern ask(const std::string& wanted_name, double height) {
    PatternCommand wanted;
    wanted.id(cycle + 1);
    wanted.name(wanted_name);
    wanted.height(height);
    print.write(wanted);
    cycle_once();
    TriggerPattern answer;
    EXPECT_TRUE(pattern.take(answer));
    EXPECT_EQ(answer.id(), wanted.id());
    return answer;
  }
  compensation::ModelStatus change(compensation::ModelCommandKind kind, const fs::path& path = {}) {
    compensation::ModelCommand sample;
    sample.id(cycle + 1000);
    sample.kind(kind);
    sample.path(path.string());
    model.write(sample);
    cycle_once();
    EXPECT_EQ(status.latest()->command_id(), sample.id());
    return *status.latest();
  }
};

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

TEST(Dispenser, AnswersWithTargetsAsTheyAreWhereNoModelIsInUse) {
  Bench bench;
  bench.bring_up();
  const TriggerPattern pattern = bench.ask("grid", 2e-3);
  ASSERT_EQ(pattern.points().size(), 6U);
  EXPECT_EQ(pattern.points()[0].droplet(), 1U);
  for (const TriggerPoint& point : pattern.points()) {
    EXPECT_EQ(point.position()[0], point.target()[0]);
    EXPECT_EQ(point.position()[1], point.target()[1]);
    EXPECT_EQ(point.position()[2], 2e-3);
    EXPECT_EQ(point.lead_ns(), 0);
  }
  EXPECT_NEAR(pattern.points()[3].target()[0], 0.064, 1e-15);  // forth and back
  EXPECT_NE(bench.ask("grit", 2e-3).refusal().size(), 0U);
  EXPECT_NE(bench.ask("grid", 0.0).refusal().size(), 0U);
}

/// compensation.yaml of the seed's head with a delay of 0.3 ms and 2 m/s.
fs::path write_model(const invar::testing::TemporaryFolder& folder, double placement_y = 118.2e-6,
                     double slope_sigma = 1e-4) {
  metrology::DropletTrajectory path;
  path.placement << 2.0e-6, placement_y;
  path.slope << 5.30508e-3, 9.01832e-5;
  path.slowness = 0.5;
  path.delay = 3e-4;
  path.covariance << 1e-12, 0.0, 0.0, slope_sigma * slope_sigma;
  path.least_height = 2e-3;
  path.most_height = 20e-3;
  const auto source = folder.write("droplets.csv", "made up\n");
  compensation::ModelText text{"dispenser", {source}};
  compensation::write_trajectory(text, path);
  text.write(folder / "compensation.yaml");
  return folder / "compensation.yaml";
}

TEST(Dispenser, MovesItsTargetsByTheModelInUseAndBack) {
  invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, write_model(folder)).state(), compensation::MODEL_STAGED);
  EXPECT_EQ(bench.ask("grid", 2e-3).model_checksum(), 0U);  // not yet
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const TriggerPattern pattern = bench.ask("grid", 20e-3);
  EXPECT_NE(pattern.model_checksum(), 0U);
  for (const TriggerPoint& point : pattern.points()) {
    // The golden numbers of the seed's head at 20 mm, and 0.3 ms + 20 mm / 2 m/s.
    EXPECT_NEAR(point.target()[0] - point.position()[0], 108.102e-6, 1e-9);
    EXPECT_NEAR(point.target()[1] - point.position()[1], 120.004e-6, 1e-9);
    EXPECT_EQ(point.lead_ns(), 10'300'000);
  }
  EXPECT_EQ(bench.change(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_NONE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 0);
}

// What `invar diagnose` writes of the same head: patched.yaml of plant droplet.
TEST(Dispenser, AimsByADiagnosedModelOfTheHead) {
  const invar::testing::TemporaryFolder folder;
  const auto head = [&](const std::string& slope_sigma, const std::string& more) {
    folder.write("patched.yaml",
                 "invar_model: 1\nplant: droplet\ncolumns: {target_x: tx, target_y: ty, height: h, time: t, "
                 "landed_x: x, "
                 "landed_y: y, velocity_x: vx, velocity_y: vy}\nparameters:\n"
                 "  placement_error_x: {value: 2.0e-6, unit: m, sigma: 1e-6}\n"
                 "  placement_error_y: {value: 118.2e-6, unit: m, sigma: 1e-6}\n"
                 "  slope_x: {value: 5.3051e-3, unit: 1" +
                     slope_sigma +
                     "}\n"
                     "  slope_y: {value: 9.0188e-5, unit: 1" +
                     slope_sigma +
                     "}\n"
                     "  speed: {value: 3, unit: m/s}\n"
                     "terms:\n  - {term: stage_velocity_carry, speed: {value: 2, unit: m/s}}\n"
                     "  - {term: valve_delay, delay: {value: 3e-4, unit: s}}\n"
                     "  - {term: camera_rotation, angle: {value: 1e-3, unit: rad}}\n" +
                     more);
    return folder / "patched.yaml";
  };
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, head(", sigma: 1e-4", "")).state(),
            compensation::MODEL_STAGED);
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const TriggerPattern pattern = bench.ask("grid", 20e-3);
  EXPECT_NE(pattern.model_checksum(), 0U);
  ASSERT_EQ(pattern.points().size(), 6U);
  for (const TriggerPoint& point : pattern.points()) {
    EXPECT_NEAR(point.target()[0] - point.position()[0], 108.102e-6, 1e-9);
    EXPECT_NEAR(point.target()[1] - point.position()[1], 120.004e-6, 1e-9);
    EXPECT_EQ(point.lead_ns(), 10'300'000);
  }
  // A slope of which nothing is known aims at nothing.
  bench.change(compensation::MODEL_STAGE, head("", ""));
  bench.change(compensation::MODEL_ACTIVATE);
  EXPECT_THAT(bench.ask("grid", 20e-3).refusal().c_str(), ::testing::HasSubstr("not certain enough"));
  folder.write("axis.yaml",
               "invar_model: 1\nplant: sensor\ncolumns: {time: t, true_position: x, encoder: e}\n");
  const auto other = bench.change(compensation::MODEL_STAGE, folder / "axis.yaml");
  EXPECT_EQ(other.state(), compensation::MODEL_REFUSED);
  EXPECT_THAT(other.text().c_str(), ::testing::HasSubstr("of plant sensor, not of a head"));
}
TEST(Dispenser, TakesItsModelOutAndBackInAndHasNoTransactions) {
  const invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  bench.change(compensation::MODEL_STAGE, write_model(folder));
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  for (const auto kind : {compensation::MODEL_KEEP, compensation::MODEL_COMMIT}) {
    const auto answer = bench.change(kind);
    EXPECT_EQ(answer.state(), compensation::MODEL_REFUSED);
    EXPECT_THAT(answer.text().c_str(), ::testing::HasSubstr("no transactions"));
    EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 10'300'000);  // still in use
  }
  EXPECT_EQ(bench.change(compensation::MODEL_CLEAR).state(), compensation::MODEL_NONE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 0);
  EXPECT_EQ(bench.change(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_ACTIVE);
  EXPECT_EQ(bench.ask("grid", 20e-3).points()[0].lead_ns(), 10'300'000);
}

TEST(Dispenser, RefusesModelsThatMustNotAim) {
  invar::testing::TemporaryFolder folder;
  Bench bench;
  bench.bring_up();
  EXPECT_EQ(bench.change(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_REFUSED);
  const auto far = bench.change(compensation::MODEL_STAGE, write_model(folder, 3e-3));
  EXPECT_EQ(far.state(), compensation::MODEL_REFUSED);
  EXPECT_THAT(far.text().c_str(), ::testing::HasSubstr("bound"));
  std::stringstream sealed;
  sealed << std::ifstream{write_model(folder)}.rdbuf();
  std::string edited = sealed.str();
  edited.replace(edited.find("slope:"), 6, "slope: [0.1, 0.1]\nold:");
  folder.write("compensation.yaml", edited);
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, folder / "compensation.yaml").state(),
            compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.change(compensation::MODEL_STAGE, folder / "nothing.yaml").state(),
            compensation::MODEL_REFUSED);
  // Certain between the heights that it was identified at, not far beyond.
  bench.change(compensation::MODEL_STAGE, write_model(folder, 118.2e-6, 4e-3));
  bench.change(compensation::MODEL_ACTIVATE);
  EXPECT_EQ(bench.ask("grid", 20e-3).refusal().size(), 0U);
  EXPECT_THAT(bench.ask("grid", 60e-3).refusal().c_str(), ::testing::HasSubstr("not certain enough"));
}

TEST(Pattern, ReadsATableAndSaysWhichRowIsWrong) {
  invar::testing::TemporaryFolder folder;
  Pattern pattern;
  pattern.kind = "file";
  pattern.file = folder.write("logo.csv", "target_x [mm],target_y [mm]\n60,50\n61.5,50\n");
  const auto points = targets(pattern);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_NEAR(points[1].x(), 0.0615, 1e-15);
  pattern.file = folder.write("hole.csv", "target_x [mm],target_y [mm]\n60,50\n61.5,\n");
  EXPECT_THROW((void)targets(pattern), InputError);
  pattern.kind = "line";
  pattern.from = {0.0, 0.0};
  pattern.to = {0.03, 0.04};
  pattern.droplets = 6;
  const auto line = targets(pattern);
  EXPECT_NEAR((line[1] - line[0]).norm(), 0.01, 1e-15);
}

}  // namespace
}  // namespace invar::dispenser
