// Droplets from pulse to substrate against closed forms, and against Newton's law where air brakes them.
#include "components/world/simulated_substrate.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <memory>

namespace invar::world {
namespace {

using namespace dispensing;

struct Bench final : Component {
  Output<sensing::ToolPosition> tool{*this, "tool"};
  Output<PressureState> pressure{*this, "pressure"};
  Output<ValvePulse> pulse{*this, "pulse"};
  Output<SubstrateCommand> command{*this, "command"};
  Inbox<LandedDroplet> landed{*this, "landed", {}, 4096};
  Input<SubstrateState> state{*this, "state"};

  SimulatedSubstrate::Parameters parameters;
  std::unique_ptr<SimulatedSubstrate> substrate;
  std::function<Eigen::Vector2d(double)> path = [](double t) { return Eigen::Vector2d{0.05 * t, 0.01}; };
  double air = 67.224e3;
  std::uint64_t cycle = 0;

  Bench() {
    parameters.scatter = parameters.scatter_per_height = parameters.diameter_scatter = 0.0;
    parameters.delay = 0.0;
  }
  void bring_up() {
    substrate = std::make_unique<SimulatedSubstrate>(parameters);
    for (auto [output, port] : std::initializer_list<std::pair<OutputPort*, const char*>>{
             {&tool, "tool"}, {&pressure, "pressure"}, {&pulse, "pulse"}, {&command, "command"}})
      output->connect(*static_cast<InputPort*>(substrate->find_port(port)));
    static_cast<OutputPort*>(substrate->find_port("landed"))->connect(landed);
    static_cast<OutputPort*>(substrate->find_port("state"))->connect(state);
    substrate->configure();
    substrate->activate();
  }
  void step(const Tick&) noexcept override {}
  void cycle_once() {
    const Tick tick{Instant{} + Duration::milliseconds(1) * static_cast<std::int64_t>(cycle), 1e-3, cycle};
    set_now(tick.now);
    substrate->set_now(tick.now);
    const Eigen::Vector2d at = path(tick.now.in_seconds());
    sensing::ToolPosition sample;
    sample.at().time_ns(tick.now.ns);
    sample.position({at.x(), at.y(), 0.0});
    tool.write(sample);
    PressureState state_of_air;
    state_of_air.pressure(air);
    pressure.write(state_of_air);
    substrate->step(tick);
    ++cycle;
  }
  /// One pulse at this time; where it lands, once the tool has been there.
  std::vector<LandedDroplet> jet(double time, std::int64_t pulse_ns = 180'000) {
    ValvePulse sample;
    sample.droplet(1);
    sample.open_ns(Duration::seconds(time).ns);
    sample.pulse_ns(pulse_ns);
    pulse.write(sample);
    std::vector<LandedDroplet> all;
    while (static_cast<double>(cycle) * 1e-3 < time + 0.01) cycle_once();
    for (LandedDroplet one; landed.take(one);) all.push_back(one);
    return all;
  }
  void fresh(double height) {
    SubstrateCommand sample;
    sample.height(height);
    command.write(sample);
    cycle_once();
  }
};

TEST(SimulatedSubstrate, CarriesTiltsAndDelaysByTheThesisNumbers) {
  // Section 11: placement (2.0, 118.2) um, tilt 0.304 deg towards 0.9739 deg: (108.102, 120.004) um at 20 mm; 50 mm/s for
  // 0.4 ms and 20 mm at 2 m/s: 20 + 500 um.
  Bench bench;
  bench.parameters.placement = {2.0e-6, 118.2e-6};
  bench.parameters.tilt = 0.0053058009;
  bench.parameters.azimuth = 0.0169977617;
  bench.parameters.delay = 4e-4;
  bench.bring_up();
  bench.fresh(20e-3);
  const auto landed = bench.jet(0.0503217);
  ASSERT_EQ(landed.size(), 1U);
  EXPECT_NEAR(landed[0].position()[0], 0.05 * 0.0503217 + 108.102e-6 + 520e-6, 2e-9);
  EXPECT_NEAR(landed[0].position()[1], 0.01 + 120.004e-6, 2e-9);
  EXPECT_EQ(landed[0].substrate(), 2U);
  EXPECT_EQ(bench.state.latest()->droplets(), 1U);
}

TEST(SimulatedSubstrate, FindsToolAndVelocityBetweenTheCyclesOfAnAcceleratedStage) {
  Bench bench;
  bench.path = [](double t) { return Eigen::Vector2d{0.5 * 3.0 * t * t, 0.02 * t}; };
  bench.bring_up();
  bench.fresh(10e-3);
  const double t = 0.0314159;
  const auto landed = bench.jet(t);
  ASSERT_EQ(landed.size(), 1U);
  EXPECT_NEAR(landed[0].position()[0], 1.5 * t * t + 3.0 * t * 5e-3, 1e-9);
  EXPECT_NEAR(landed[0].position()[1], 0.02 * t + 0.02 * 5e-3, 1e-9);
}

TEST(SimulatedSubstrate, SizesAreThoseOfTheThesisTwoCases) {
  Bench bench;
  bench.bring_up();
  EXPECT_NEAR(bench.jet(0.02)[0].diameter(), 0.619e-3, 1e-9);
  bench.air = 10.0 * 6894.757;
  bench.cycle_once();
  EXPECT_NEAR(bench.jet(0.05, 200'000)[0].diameter(), 0.664e-3, 1e-6);
}

TEST(SimulatedSubstrate, NothingLeavesWithoutPressureOrBeforeTheValveIsOpen) {
  Bench bench;
  bench.bring_up();
  EXPECT_THAT(bench.jet(0.02, 80'000), ::testing::IsEmpty());
  bench.air = 5e3;
  bench.cycle_once();
  EXPECT_THAT(bench.jet(0.05), ::testing::IsEmpty());
}

TEST(SimulatedSubstrate, SlowerDropletsAreCarriedFarther) {
  Bench bench;
  bench.parameters.speed_decay = 1e-2;
  bench.bring_up();
  bench.fresh(20e-3);
  const double late = 5.0;
  const auto landed = bench.jet(late);
  ASSERT_EQ(landed.size(), 1U);
  EXPECT_NEAR(landed[0].position()[0] - 0.05 * late, 500e-6 * std::exp(0.05), 1e-8);
}

TEST(SimulatedSubstrate, SatellitesAreSmallMarkedAndAsManyAsAsked) {
  Bench bench;
  bench.parameters.satellites = 0.2;
  bench.parameters.seed = 11;
  bench.bring_up();
  int satellites = 0;
  for (int i = 0; i < 400; ++i)
    for (const LandedDroplet& one : bench.jet(0.02 + 0.012 * i)) {
      satellites += one.satellite() ? 1 : 0;
      EXPECT_EQ(one.satellite(), one.diameter() < 0.25e-3);
    }
  EXPECT_NEAR(satellites, 80, 32);  // four standard deviations, seed 11
}

TEST(SimulatedSubstrate, ScatterGrowsWithTheHeightAsAsked) {
  Bench bench;
  bench.parameters.scatter = 8e-6;
  bench.parameters.scatter_per_height = 1e-3;
  bench.parameters.seed = 12;
  bench.path = [](double) { return Eigen::Vector2d{0.01, 0.01}; };
  bench.bring_up();
  for (const double height : {2e-3, 20e-3}) {
    bench.fresh(height);
    double squares = 0.0;
    const double begin = 0.02 + static_cast<double>(bench.cycle) * 1e-3;
    for (int i = 0; i < 500; ++i) {
      const auto at = bench.jet(begin + 0.012 * i)[0].position();
      squares += std::pow(at[0] - 0.01, 2) + std::pow(at[1] - 0.01, 2);
    }
    EXPECT_NEAR(std::sqrt(squares / 1000.0) / std::hypot(8e-6, 1e-3 * height), 1.0, 0.1);
  }
}

}  // namespace
}  // namespace invar::world
