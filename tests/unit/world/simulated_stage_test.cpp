// A simulated machine goes on while its controller misses cycles, as a real one does.
#include "components/world/simulated_stage.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace invar::world {
namespace {

struct Ends final : Component {
  Output<stage::MotorCommand> motor{*this, "motor"};
  Input<sensing::AxisReading> truth{*this, "truth"};
  void step(const Tick&) noexcept override {}
};

constexpr double mass = 2.0, motor_constant = 10.0, current = 0.5, dt = 1e-3;

/// Where an axis without friction is when it was last commanded in cycle `silent`, and steps no more until cycle `again`.
double position_after(int silent, int again) {
  SimulatedStage::Parameters parameters;
  parameters.machine = std::filesystem::path{INVAR_SOURCE_DIR} / "deployment/machines/linear-axis.yaml";
  parameters.x.mass = mass;
  parameters.x.motor_constant = motor_constant;
  parameters.x.viscous_damping = 0.0;
  SimulatedStage world{parameters};
  Ends ends;
  EXPECT_TRUE(ends.motor.connect(*static_cast<InputPort*>(world.find_port("motor_x"))));
  EXPECT_TRUE(static_cast<OutputPort*>(world.find_port("truth_x"))->connect(ends.truth));
  world.configure();
  world.set_now(Instant{});
  world.activate();
  for (int k = 0; k <= again; ++k) {
    if (k > silent && k < again) continue;
    const Instant now{static_cast<std::int64_t>(k) * 1'000'000};
    world.set_now(now);
    world.step({now, dt, static_cast<std::uint64_t>(k)});
    if (k > silent) continue;
    stage::MotorCommand command;
    command.at().time_ns(now.ns);
    command.enabled(true);
    command.current(current);
    ends.motor.write(command);
  }
  return ends.truth.latest()->position();
}

TEST(SimulatedStage, KeepsMovingWhileItsControllerMissesCycles) {
  const double a = motor_constant * current / mass;
  EXPECT_NEAR(position_after(15, 16), 0.5 * a * 15e-3 * 15e-3, 2.0 * a * dt * 16e-3);
  EXPECT_DOUBLE_EQ(position_after(1, 16), position_after(15, 16));  // held: as if it had been commanded again
}

TEST(SimulatedStage, IsLetGoByItsDriveWhenTheControllerIsSilentForLonger) {
  const double a = motor_constant * current / mass;
  // The watchdog lets go 20 ms after the last command: it coasts for the other 80 ms.
  const double speed = a * 20e-3, expected = 0.5 * a * 20e-3 * 20e-3 + speed * 80e-3;
  EXPECT_NEAR(position_after(0, 100), expected, 0.06 * expected);
}

}  // namespace
}  // namespace invar::world
