#include "components/stage/axis_stage.hpp"
#include "tests/support/stage_bench.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <random>

namespace invar::stage {
namespace {

using Bench = StageBench;

/// A bench whose carriage hangs on a spring that the servo's numbers know nothing of.
struct Sprung final : Bench {
  Output<compensation::ModelCommand> order{*this, "order"};
  Input<compensation::ModelStatus> answer{*this, "answer"};
  invar::testing::TemporaryFolder folder;
  std::uint64_t orders = 0;

  Sprung() {
    stage.simulated_time = true;
    join(order, "model");
    static_cast<OutputPort*>(stage.find_port("model_status"))->connect(answer);
    spring = 600.0;
  }

  std::string model(double stiffness, const std::string& plant = "axis") {
    const auto file = folder / "model.yaml";
    std::ofstream{file} << "invar_model: 1\nplant: " << plant
                        << "\ncolumns: {time: t, reference: r, position: y, current: u}\n"
                           "controller: {kind: pid, rate: 1000, kp: 1}\n"
                           "parameters: {mass: {value: 3, unit: kg}, motor_constant: {value: 12, unit: N/A}, "
                           "viscous_damping: {value: 0, unit: N s/m}}\n"
                           "terms: [{term: position_stiffness, stiffness: {value: "
                        << stiffness << ", unit: N/m}, center: {value: 0.05, unit: m}}]\n";
    return file.string();
  }
  compensation::ModelStatus tell(compensation::ModelCommandKind kind, const std::string& path = "") {
    compensation::ModelCommand sample;
    sample.id(++orders);
    sample.kind(kind);
    sample.path(path);
    order.write(sample);
    cycle_once();
    return *answer.latest();
  }
  /// Largest following error of a move there and back.
  double following_error() {
    double worst = 0.0;
    for (const double target : {0.12, 0.05}) {
      send(AXIS_COMMAND_MOVE, target);
      EXPECT_TRUE(run_until([&](const AxisState& s) {
        worst = std::max(worst, std::abs(s.following_error()));
        return s.command_id() == next_id - 1 && s.command_done() && s.settled();
      }));
    }
    return worst;
  }
};

TEST(Stage, FeedsForwardTheForcesOfAModelThatIsLoadedWhileRunning) {
  Sprung bench;
  bench.enable();
  const double before = bench.following_error();
  EXPECT_EQ(bench.tell(compensation::MODEL_STAGE, bench.model(600.0)).state(), compensation::MODEL_STAGED);
  EXPECT_EQ(bench.tell(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  EXPECT_NE(bench.answer.latest()->model_checksum(), 0U);
  const double after = bench.following_error();
  EXPECT_LT(after, 0.2 * before) << before << ' ' << after;
  EXPECT_EQ(bench.tell(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_NONE);
  EXPECT_NEAR(bench.following_error(), before, 0.05 * before);
}

TEST(Stage, TakesItsModelOutByCommandAndHasNoTransactions) {
  Sprung bench;
  bench.enable();
  (void)bench.tell(compensation::MODEL_STAGE, bench.model(600.0));
  ASSERT_EQ(bench.tell(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_ACTIVE);
  const double with = bench.following_error();
  EXPECT_EQ(bench.tell(compensation::MODEL_COMMIT).state(), compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.tell(compensation::MODEL_KEEP).state(), compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.tell(compensation::MODEL_CLEAR).state(), compensation::MODEL_NONE);
  const double without = bench.following_error();
  EXPECT_GT(without, 4.0 * with);
  EXPECT_EQ(bench.tell(compensation::MODEL_ROLLBACK).state(), compensation::MODEL_ACTIVE);
  (void)bench.following_error();  // it fades in
  EXPECT_LT(bench.following_error(), 0.25 * without);
}

TEST(Stage, AnotherModelDoesNotMakeTheCarriageJump) {
  Sprung bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.12);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_done() && s.settled(); }));
  (void)bench.tell(compensation::MODEL_STAGE, bench.model(600.0));
  const double current = bench.state.latest()->current();
  (void)bench.tell(compensation::MODEL_ACTIVATE);
  EXPECT_NEAR(bench.state.latest()->current(), current, 0.06);
  for (int i = 0; i < 500; ++i) {
    bench.cycle_once();
    ASSERT_LT(std::abs(bench.position - 0.12), 2e-6) << i;
  }
}

TEST(Stage, RefusesAModelThatIsNoneOfAnAxisOrLeavesNoCurrentForTheServo) {
  Sprung bench;
  bench.enable();
  const auto stiff = bench.tell(compensation::MODEL_STAGE, bench.model(5000.0));
  EXPECT_EQ(stiff.state(), compensation::MODEL_REFUSED);
  EXPECT_NE(std::string{stiff.text().c_str()}.find("0.8 of the limit"), std::string::npos)
      << stiff.text().c_str();
  EXPECT_EQ(bench.tell(compensation::MODEL_STAGE, bench.model(600.0, "sensor")).state(),
            compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.tell(compensation::MODEL_STAGE, "/nowhere.yaml").state(), compensation::MODEL_REFUSED);
  EXPECT_EQ(bench.tell(compensation::MODEL_ACTIVATE).state(), compensation::MODEL_REFUSED);
}

TEST(Stage, EnablingDoesNotMoveTheCarriage) {
  Bench bench;
  bench.enable();
  for (int i = 0; i < 1000; ++i) {
    bench.cycle_once();
    ASSERT_NEAR(bench.position, 0.05, 1e-12);
  }
}

TEST(Stage, MovesWhereItIsToldAndSettles) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_done() && s.settled(); }));
  EXPECT_NEAR(bench.position, 0.15, 1e-6);
  EXPECT_EQ(bench.state.latest()->command_id(), 2U);
}

TEST(Stage, AddsTheCorrectionToTheSetpoint) {
  Bench bench;
  bench.enable();
  compensation::AxisCorrection correction;
  correction.correction(-3e-6);
  bench.correction.write(correction);
  bench.send(AXIS_COMMAND_MOVE, 0.1);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_done() && s.settled(); }));
  EXPECT_NEAR(bench.position, 0.1 - 3e-6, 1e-6);
}

TEST(Stage, RefusesMovesOutsideItsSoftLimitsAndWhileMoving) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.3);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_id() == 2; }, 5));
  EXPECT_TRUE(bench.state.latest()->command_refused());
  bench.send(AXIS_COMMAND_MOVE, 0.1);
  bench.cycle_once();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_id() == 4; }, 5));
  EXPECT_TRUE(bench.state.latest()->command_refused());
}

TEST(Stage, RefusesNumbersThatAreNoneWithAReasonAndStandsStill) {
  Bench bench;
  bench.enable();
  const double stands = bench.position;
  std::uint64_t id = 50;
  for (const double value : {std::nan(""), -0.1, std::numeric_limits<double>::infinity()}) {
    AxisCommand move;
    move.kind(AXIS_COMMAND_MOVE);
    move.position(0.1);
    move.velocity(value);
    move.id(++id);
    bench.command.write(move);
    ASSERT_TRUE(bench.run_until([&](const AxisState& s) { return s.command_id() == id; }, 5));
    EXPECT_TRUE(bench.state.latest()->command_refused()) << value;
    EXPECT_TRUE(bench.state.latest()->command_done());
    const std::string why = bench.notices.latest()->text().c_str();
    EXPECT_NE(why.find("its velocity is"), std::string::npos) << why;
    EXPECT_NE(why.find("send a positive number, or 0 for the axis's own"), std::string::npos) << why;
    for (int i = 0; i < 1000; ++i) bench.cycle_once();  // the same reason is told once a second
  }
  EXPECT_NEAR(bench.position, stands, 1e-6);
  bench.send(AXIS_COMMAND_MOVE, 0.3);
  ASSERT_TRUE(
      bench.run_until([](const AxisState& s) { return s.command_refused() && s.command_id() < 50; }, 5));
  EXPECT_NE(std::string{bench.notices.latest()->text().c_str()}.find("outside the axis's travel"),
            std::string::npos);
}

TEST(Stage, FollowsASineAndRefusesOneBeyondItsLimits) {
  Bench bench;
  bench.enable();
  AxisCommand sine;
  sine.kind(AXIS_COMMAND_SINE);
  sine.amplitude(0.02);
  sine.period(2.0);
  sine.periods(2);
  sine.id(100);
  bench.command.write(sine);
  double largest = 0.0;
  ASSERT_TRUE(bench.run_until([&](const AxisState& s) {
    largest = std::max(largest, bench.position);
    return s.command_id() == 100 && s.command_done();
  }));
  EXPECT_FALSE(bench.state.latest()->command_refused());
  EXPECT_NEAR(largest, 0.05 + 2 * 0.02, 5e-6);
  EXPECT_NEAR(bench.position, 0.05, 5e-6);
  const auto refused = [&](double amplitude, double period, std::uint32_t periods) {
    sine.amplitude(amplitude);
    sine.period(period);
    sine.periods(periods);
    sine.id(sine.id() + 1);
    bench.command.write(sine);
    return bench.run_until([&](const AxisState& s) { return s.command_id() == sine.id(); }, 5) &&
           bench.state.latest()->command_refused();
  };
  EXPECT_TRUE(refused(0.08, 10.0, 1));  // leaves the travel
  EXPECT_TRUE(refused(0.02, 1.0, 1));   // 0.126 m/s
  EXPECT_TRUE(refused(0.001, 0.1, 1));  // 3.9 m/s2
  EXPECT_TRUE(refused(0.02, 2.0, 0));
  EXPECT_TRUE(refused(0.02, 0.0, 1));
  EXPECT_FALSE(refused(-0.02, 2.0, 1));
}

TEST(Stage, LostFeedbackBrakesUnderControlAndThenLetsGo) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([&](const AxisState&) { return bench.velocity > 0.09; }));
  bench.seeing = false;
  // The braking has begun two periods after the last sample can have been used.
  for (int i = 0; i < 4; ++i) bench.cycle_once();
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_STOPPING);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.mode() == AXIS_MODE_FAULT; }, 1000));
  EXPECT_FALSE(bench.motor.latest()->enabled());
  EXPECT_LT(std::abs(bench.velocity), 2e-3);
  bench.seeing = true;
  bench.cycle_once();
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_FAULT);  // stays stopped until somebody clears it
  bench.send(AXIS_COMMAND_CLEAR_FAULT);
  bench.cycle_once();
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_DISABLED);
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Runs on until the axis trips; every number on the way must be one. What the notice said.
std::string trip_of(Bench& bench) {
  const bool tripped = bench.run_until(
      [&](const AxisState& s) {
        EXPECT_TRUE(std::isfinite(bench.motor.latest()->current()));
        EXPECT_TRUE(std::isfinite(s.position()) && std::isfinite(s.following_error()));
        return s.mode() == AXIS_MODE_FAULT;
      },
      1000);
  EXPECT_TRUE(tripped);
  EXPECT_FALSE(bench.motor.latest()->enabled());
  const auto* notice = bench.notices.latest();
  return notice != nullptr ? notice->text().c_str() : "";
}

TEST(Stage, AnEncoderThatGivesNoNumberIsLostFeedback) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([&](const AxisState&) { return bench.velocity > 0.09; }));
  bench.encoder_error = nan;
  for (int i = 0; i < 4; ++i) bench.cycle_once();
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_STOPPING);
  EXPECT_NE(trip_of(bench).find("the encoder's position or velocity is not a number"), std::string::npos);
  EXPECT_LT(std::abs(bench.velocity), 2e-3);
  bench.send(AXIS_COMMAND_CLEAR_FAULT);
  bench.send(AXIS_COMMAND_ENABLE);
  bench.cycle_once();
  EXPECT_FALSE(bench.motor.latest()->enabled());
}

TEST(Stage, OneSampleThatIsNoNumberIsBridged) {
  Bench bench;
  bench.enable();
  bench.encoder_error = nan;
  bench.cycle_once();
  bench.encoder_error = 0.0;
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(bench.cycle_once().enabled());
  EXPECT_NEAR(bench.position, 0.05, 1e-9);
}

TEST(Stage, ACorrectionThatIsNoNumberIsALostInput) {
  Bench bench;
  bench.enable();
  compensation::AxisCorrection correction;
  correction.correction(nan);
  bench.correction.write(correction);
  EXPECT_NE(trip_of(bench).find("the correction is not a number"), std::string::npos);
}

TEST(Stage, AFaultOfTheDriveTrips) {
  Bench bench;
  bench.enable();
  bench.drive_fault = true;
  EXPECT_NE(trip_of(bench).find("its drive reports a fault"), std::string::npos);
  EXPECT_EQ(bench.notices.received(), 1U);
}

TEST(Stage, FollowingErrorTrips) {
  Bench bench;
  bench.enable();
  bench.position += 2e-3;  // somebody pushed the carriage
  bench.cycle_once();
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_FAULT);
  EXPECT_FALSE(bench.motor.latest()->enabled());
}

TEST(Stage, HomingFindsTheSwitchAndCountsFromIt) {
  Bench bench;
  bench.parameters.absolute_encoder = false;
  bench.stage.activate();
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.1);
  bench.cycle_once();
  EXPECT_TRUE(bench.state.latest()->command_refused());  // not homed yet
  bench.send(AXIS_COMMAND_HOME);
  ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.homed() && s.command_done(); }));
  EXPECT_LT(bench.position, 0.0);
  EXPECT_GT(bench.position, -1e-3);
}

TEST(Stage, BrakesWithinItsLimitsBeforeItIsDeactivated) {
  Bench bench;
  bench.enable();
  EXPECT_TRUE(bench.stage.wind_down());  // it stands
  bench.stage.activate();
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([&](const AxisState&) { return bench.velocity > 0.09; }));
  const double from = bench.position;
  int cycles = 0;
  for (; !bench.stage.wind_down(); ++cycles) {
    ASSERT_LT(cycles, 200);
    if (cycles == 5) bench.send(AXIS_COMMAND_MOVE, 0.0);
    const double before = bench.velocity;
    ASSERT_TRUE(bench.cycle_once().enabled());
    ASSERT_TRUE(bench.motor.latest()->enabled());
    EXPECT_LE(std::abs(bench.state.latest()->setpoint_acceleration()), 2.0 + 1e-9);
    EXPECT_LE(std::abs(bench.velocity - before) / Bench::period, 2.2);
  }
  EXPECT_GT(cycles, 45);  // 0.09 m/s at 2 m/s2
  EXPECT_LT(std::abs(bench.velocity), 2e-3);
  EXPECT_LT(bench.position - from, 0.01);  // 2 mm of braking, 3 mm of jerk
  EXPECT_TRUE(bench.state.latest()->command_refused());
  bench.stage.deactivate();
  bench.stage.activate();
  bench.enable();  // as new
}

TEST(Stage, BrakesBeforeItLetsGoWhenItIsDisabled) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([&](const AxisState&) { return bench.velocity > 0.09; }));
  bench.send(AXIS_COMMAND_DISABLE);
  bench.send(AXIS_COMMAND_DISABLE);  // said twice it is still once
  ASSERT_TRUE(bench.run_until(
      [&](const AxisState& s) {
        EXPECT_TRUE(s.enabled() || std::abs(bench.velocity) < 2e-3) << bench.velocity;
        return s.mode() == AXIS_MODE_DISABLED;
      },
      200));
  EXPECT_TRUE(bench.state.latest()->command_done());
  EXPECT_FALSE(bench.state.latest()->command_refused());
  bench.enable();
  EXPECT_TRUE(bench.run_until([](const AxisState& s) { return s.settled(); }, 100));
}

TEST(Stage, AtRestAndAboutToLeaveItDoesNotTripWhenItsPlantHasLeft) {
  Bench bench;
  bench.enable();
  EXPECT_TRUE(bench.stage.wind_down());
  bench.seeing = false;
  for (int i = 0; i < 100; ++i) ASSERT_NE(bench.cycle_once().mode(), AXIS_MODE_FAULT) << i;
  EXPECT_EQ(bench.state.latest()->mode(), AXIS_MODE_DISABLED);
  EXPECT_FALSE(bench.motor.latest()->enabled());
  EXPECT_EQ(bench.notices.received(), 0U);
}

TEST(Stage, LetGoWhileItMovesItSaysWhichAxisAndHowFast) {
  Bench bench;
  bench.enable();
  bench.stage.deactivate();
  EXPECT_EQ(bench.notices.received(), 0U);  // it stood
  bench.stage.activate();
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  ASSERT_TRUE(bench.run_until([&](const AxisState&) { return bench.velocity > 0.099; }));
  bench.stage.deactivate();
  ASSERT_EQ(bench.notices.received(), 1U);
  const std::string text = bench.notices.latest()->text().c_str();
  EXPECT_EQ(text.find("axis 0 is disabled while it moves at 0.09"), 0U) << text;
}

// Whatever numbers a command carries: every current is one within its limit, and setpoints keep to the axis' limits.
TEST(Stage, NoCommandTakesItBeyondItsLimits) {
  const auto seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random{seed};
  constexpr double inf = std::numeric_limits<double>::infinity();
  const std::vector<double> edges{0.0,    -0.0, nan,   inf,  -inf, 5e-324,     1e-300, 1e300,
                                  -1e300, 1e-9, -1e-9, 1e-3, 0.01, 0.05,       0.1,    0.2,
                                  0.15,   2.0,  60.0,  1e9,  -0.1, 0.2 + 1e-15};
  const auto any = [&](const auto& from) { return from[random() % from.size()]; };
  const std::vector<AxisCommandKind> kinds{AXIS_COMMAND_ENABLE, AXIS_COMMAND_DISABLE,    AXIS_COMMAND_MOVE,
                                           AXIS_COMMAND_MOVE,   AXIS_COMMAND_MOVE,       AXIS_COMMAND_SINE,
                                           AXIS_COMMAND_STOP,   AXIS_COMMAND_CLEAR_FAULT};
  Bench bench;
  bench.enable();
  const Stage::Limits& limits = bench.parameters.limits;
  int moved = 0;
  for (int round = 0; round < 4000; ++round) {
    AxisCommand command;
    command.id(bench.next_id++);
    command.kind(any(kinds));
    command.position(any(edges));
    command.velocity(any(edges));
    command.acceleration(any(edges));
    command.jerk(any(edges));
    command.amplitude(any(edges));
    command.period(any(edges));
    command.periods(static_cast<std::uint32_t>(random() % 4));
    bench.command.write(command);
    for (auto cycles = random() % 60; cycles > 0; --cycles) {
      const AxisState& s = bench.cycle_once();
      ASSERT_TRUE(std::abs(bench.motor.latest()->current()) <= bench.parameters.control.limit) << round;
      // Without a motor the carriage, which has no friction, drifts on at some um/s: a move may begin a little outside.
      ASSERT_TRUE(!s.moving() || (s.setpoint_position() > -1e-4 && s.setpoint_position() < 0.2 + 1e-4))
          << round << ": " << s.setpoint_position();
      ASSERT_TRUE(std::abs(s.setpoint_velocity()) <= limits.velocity * (1 + 1e-6)) << s.setpoint_velocity();
      ASSERT_TRUE(std::abs(s.setpoint_acceleration()) <= limits.acceleration * (1 + 1e-6))
          << s.setpoint_acceleration();
      ASSERT_NE(s.mode(), AXIS_MODE_FAULT) << round << ": " << bench.notices.latest()->text().c_str();
      moved += static_cast<int>(s.moving());
    }
  }
  EXPECT_GT(moved, 5000);
  for (const auto kind : {AXIS_COMMAND_STOP, AXIS_COMMAND_ENABLE}) {
    bench.send(kind);
    ASSERT_TRUE(bench.run_until([](const AxisState& s) { return s.command_done() && !s.moving(); })) << kind;
  }
  bench.send(AXIS_COMMAND_MOVE, 0.12);
  EXPECT_TRUE(bench.run_until([](const AxisState& s) { return s.command_done() && s.settled(); }));
  EXPECT_NEAR(bench.position, 0.12, 1e-6);
}

TEST(Stage, SafeValueLetsGoOfTheMotor) {
  Bench bench;
  bench.enable();
  static_cast<OutputPort*>(bench.stage.find_port("motor"))->write_safe_value();
  EXPECT_FALSE(bench.motor.latest()->enabled());
}

}  // namespace
}  // namespace invar::stage
