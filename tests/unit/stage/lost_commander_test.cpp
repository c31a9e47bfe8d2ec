// An axis whose commander is not heard any more: it stops by its own deceleration, or finishes, as the file says.
#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/real_time_guard.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::stage {
namespace {

using ::testing::HasSubstr;

struct Transport final : Component {
  Output<commander::Link> link{*this, "link"};
  Inbox<event::Notice> notices{*this, "notices", {}, 64};
  void step(const Tick&) noexcept override {}
};

struct Commanded {
  explicit Commanded(const char* lost_commander) : axis{of_world(), of_stage(lost_commander)} {
    axis.wired.join(transport, "link", axis.stage, "commander");
    axis.wired.join(axis.stage, "notices", transport, "notices");
    axis.wired.add(axis.world);
    axis.wired.add(axis.stage);
    axis.wired.start();
    run(20);
    axis.tell(AXIS_COMMAND_ENABLE);
    run(20);
    axis.tell(AXIS_COMMAND_MOVE, 0.15);
    silent(0);
    run(300);
  }
  static world::SimulatedStage::Parameters of_world() {
    world::SimulatedStage::Parameters world;
    world.machine = INVAR_SOURCE_DIR "/deployment/machines/linear-axis.yaml";
    world.x.start = 0.02;
    return world;
  }
  static Stage::Parameters of_stage(const char* lost_commander) {
    Stage::Parameters stage;
    stage.lost_commander = lost_commander;
    stage.control.feedforward_acceleration = 3.2 / 12.0;
    stage.control.feedforward_velocity = 25.0 / 12.0;
    return stage;
  }
  void silent(std::int64_t ms) {
    commander::Link link;
    link.silence_ns(ms == INT64_MAX ? ms : ms * 1'000'000);
    link.who("`trials` on 10.0.0.2");
    transport.link.write(link);
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) axis.wired.step();
    for (event::Notice notice; transport.notices.take(notice);) said = notice.text().c_str();
  }
  const AxisState& state() { return *axis.hand.state.latest(); }

  support::WiredAxis axis;
  Transport transport;
  std::string said;
};

TEST(LostCommander, StopsTheAxisByItsOwnDeceleration) {
  for (const std::int64_t silence : {std::int64_t{80}, std::int64_t{INT64_MAX}}) {
    Commanded on{"stop"};
    ASSERT_GT(on.state().velocity(), 0.09);
    on.silent(79);
    on.run(10);
    EXPECT_EQ(on.state().mode(), AXIS_MODE_MOVING);
    const double from = on.state().setpoint_position(), speed = on.state().setpoint_velocity();
    on.silent(silence);
    on.run(1);
    EXPECT_EQ(on.state().mode(), AXIS_MODE_STOPPING);
    on.run(500);
    EXPECT_EQ(on.state().mode(), AXIS_MODE_HOLDING);
    EXPECT_TRUE(on.state().command_refused() && on.state().command_done());
    EXPECT_THAT(on.said, HasSubstr("stopped: its commander, `trials` on 10.0.0.2, is lost"));
    const Stage::Limits own;
    const double way = speed * speed / (2.0 * own.acceleration) + speed * own.acceleration / (2.0 * own.jerk);
    EXPECT_NEAR(on.state().position() - from, way, 0.02 * way + 2e-4);
    // A new command moves it again, and it is said that somebody is heard.
    on.silent(0);
    on.run(5);
    EXPECT_THAT(on.said, HasSubstr("is heard"));
    on.axis.tell(AXIS_COMMAND_MOVE, 0.16);
    on.run(2500);
    EXPECT_NEAR(on.state().position(), 0.16, 1e-6);
  }
}

TEST(LostCommander, FinishesWhereTheFileSaysSo) {
  Commanded on{"finish"};
  on.silent(INT64_MAX);
  on.run(2500);
  EXPECT_NEAR(on.state().position(), 0.15, 1e-6);
  EXPECT_FALSE(on.state().command_refused());
  EXPECT_THAT(on.said, HasSubstr("goes on to the end of its motion"));
}

TEST(LostCommander, OfAnAxisAtRestSaysNothing) {
  Commanded on{"stop"};
  on.run(2500);
  on.silent(INT64_MAX);
  on.run(10);
  EXPECT_EQ(on.said, "");
  EXPECT_EQ(on.state().mode(), AXIS_MODE_HOLDING);
}

TEST(LostCommander, NeitherAllocatesNorLocks) {
  Commanded on{"stop"};
  on.silent(INT64_MAX);
  const support::RealTimeGuard count;
  for (int i = 0; i < 300; ++i) on.axis.wired.step();
  EXPECT_EQ(count.violations(), 0U);
}

}  // namespace
}  // namespace invar::stage
