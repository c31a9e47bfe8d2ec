// An axis whose feedback, fused position or correction stays away: it ends in hold or drive off, within two periods, told.
#include <gmock/gmock.h>

#include <cmath>

#include "components/stage/input_watch.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::stage {
namespace {

using ::testing::HasSubstr;

enum class Lost { feedback, fused, correction };

/// Stands between world and stage: passes feedback on, fuses it (exactly) and corrects by a micrometre, until it stops.
struct Between final : Component {
  Input<AxisFeedback> from{*this, "from"};
  Output<AxisFeedback> feedback{*this, "feedback"};
  Output<sensing::FusedPosition> fused{*this, "fused"};
  Output<compensation::AxisCorrection> correction{*this, "correction"};
  Inbox<event::Notice> notices{*this, "notices", {}, 64};
  bool without[3] = {};
  void step(const Tick&) noexcept override {
    if (from.latest() == nullptr) return;
    const AxisFeedback sample = *from.latest();
    if (!without[static_cast<int>(Lost::feedback)]) feedback.write(sample);
    sensing::FusedPosition position;
    position.position(sample.position());
    position.valid(true);
    if (!without[static_cast<int>(Lost::fused)]) fused.write(position);
    compensation::AxisCorrection corrected;
    corrected.correction(1e-6);
    if (!without[static_cast<int>(Lost::correction)]) correction.write(corrected);
  }
};

struct LostAxis {
  world::SimulatedStage::Parameters of_world;
  Stage::Parameters of_stage;
  Between between;
  std::unique_ptr<world::SimulatedStage> world;
  std::unique_ptr<Stage> stage;
  support::Hand hand;
  support::Wired wired;
  std::string said;
  Instant said_at;

  LostAxis(const std::string& on_lost_input, int correction_every) {
    of_world.machine = INVAR_SOURCE_DIR "/deployment/machines/linear-axis.yaml";
    of_world.x.start = 0.02;
    of_stage.on_lost_input = on_lost_input;
    of_stage.control.feedforward_acceleration = 3.2 / 12.0;
    of_stage.control.feedforward_velocity = 25.0 / 12.0;
    world = std::make_unique<world::SimulatedStage>(of_world);
    stage = std::make_unique<Stage>(of_stage);
    wired.join(*stage, "motor", *world, "motor_x");
    wired.join(*world, "feedback_x", between, "from");
    for (const char* port : {"feedback", "fused", "correction"}) wired.join(between, port, *stage, port);
    wired.join(*stage, "notices", between, "notices");
    wired.join(*stage, "state", hand, "state");
    wired.join(hand, "command", *stage, "command");
    wired.add(*world);
    wired.add(between, correction_every);
    wired.add(*stage);
    wired.start();
    run(20);
    tell(AXIS_COMMAND_ENABLE);
    run(20);
  }
  void tell(AxisCommandKind kind, double position = 0.0) {
    AxisCommand command;
    command.kind(kind);
    command.position(position);
    command.id(++id);
    hand.command.write(command);
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      wired.step();
      event::Notice notice;
      while (between.notices.take(notice)) said = notice.text().c_str(), said_at = wired.now();
    }
  }
  const AxisState& state() { return *hand.state.latest(); }
  std::uint64_t id = 0;
};

TEST(LostInput, EndsInHoldOrOffAsTheFileSaysWithinTwoPeriodsAndTold) {
  for (const Lost lost : {Lost::feedback, Lost::fused, Lost::correction})
    for (const char* ends : {"hold", "off"}) {
      SCOPED_TRACE(::testing::Message() << "lost " << static_cast<int>(lost) << ", " << ends);
      LostAxis axis{ends, 1};
      axis.tell(AXIS_COMMAND_MOVE, 0.15);
      axis.run(300);
      ASSERT_GT(axis.state().velocity(), 0.09);
      EXPECT_EQ(axis.said, "");
      axis.between.without[static_cast<int>(lost)] = true;
      const Instant from = axis.wired.now();
      axis.run(4);
      EXPECT_EQ(axis.state().mode(), AXIS_MODE_STOPPING);
      EXPECT_LE(axis.said_at - from, Duration::milliseconds(4))
          << axis.said;  // two periods, and the cycle that looks
      EXPECT_THAT(axis.said,
                  HasSubstr(lost == Lost::correction ? "the correction stays away" : "without feedback"));
      axis.run(400);
      EXPECT_EQ(axis.state().mode(), std::string{ends} == "hold" ? AXIS_MODE_HOLDING : AXIS_MODE_FAULT);
      EXPECT_TRUE(axis.state().command_refused() || std::string{ends} == "off");
      const double stands = axis.state().position();
      axis.tell(AXIS_COMMAND_MOVE, 0.15);
      axis.run(50);
      EXPECT_TRUE(axis.state().command_refused());
      EXPECT_NEAR(axis.state().position(), stands, 1e-4);
      axis.between.without[static_cast<int>(lost)] = false;
      axis.run(300);
      axis.tell(AXIS_COMMAND_MOVE, 0.16);
      axis.run(1500);
      if (std::string{ends} == "hold") {
        EXPECT_NEAR(axis.state().position(), 0.16 + 1e-6, 1e-6) << axis.said;
      } else {
        EXPECT_EQ(axis.state().mode(), AXIS_MODE_FAULT);
      }
    }
}

TEST(LostInput, ASlowerInputIsLostAfterTwoOfItsPeriods) {
  InputWatch watch;
  std::uint64_t received = 0;
  for (int i = 0; i < 400; ++i) EXPECT_FALSE(watch.lost(i % 20 == 0 ? ++received : received, 2.0)) << i;
  // The last came in step 380: with the 20 steps since it has been away for one period.
  int until_lost = 0;
  while (!watch.lost(received, 2.0)) ++until_lost;
  EXPECT_EQ(until_lost, 20);
  EXPECT_FALSE(watch.lost(++received, 2.0));
}

TEST(LostInput, WhatCameOnceOnlyIsNotMissed) {
  InputWatch watch;
  for (int i = 0; i < 10'000; ++i) EXPECT_FALSE(watch.lost(i < 5 ? 0U : 1U, 2.0));
}

}  // namespace
}  // namespace invar::stage
