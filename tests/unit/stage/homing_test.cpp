// Homing on the simulated axis, by every way and with every switch that fails; the truth is where the carriage stands.
#include "components/stage/homing.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "tests/support/real_time_guard.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::stage {
namespace {

using ::testing::HasSubstr;

constexpr double low = 0.0, high = 0.2;  // travel of linear-axis.yaml

constexpr double search = 0.05;  // m/s

/// The longest way that a stop takes from anywhere in a search [m], and what the servo and a cycle add.
double braking_way() {
  const Stage::Limits own;
  const MotionLimits limits{search, own.acceleration, own.jerk};
  const auto move = Trajectory::move(0.0, 0.2, limits);
  double longest = 0.0;
  for (double t = 0.0; t < 0.2; t += 1e-4)
    longest = std::max(longest, Trajectory::stop(move.at(t), limits).target() - move.at(t).position);
  return longest + 2e-4;
}
const double braking = braking_way();

struct Ears final : Component {
  Inbox<event::Notice> notices{*this, "notices", {}, 64};
  Input<sensing::AxisReading> truth{*this, "truth"};
  void step(const Tick&) noexcept override {}
};

struct HomingAxis {
  world::SimulatedStage::Parameters of_world;
  Stage::Parameters of_stage;
  std::unique_ptr<support::WiredAxis> axis;
  Ears ears;
  double lowest = 1e9, highest = -1e9;  // where the carriage came to in truth
  std::string said;
  bool dead_motor = false;

  HomingAxis() {
    of_world.machine = INVAR_SOURCE_DIR "/deployment/machines/linear-axis.yaml";
    of_world.x.ends.incremental = true;
    of_stage.travel = {low, high};
    of_stage.absolute_encoder = false;
    of_stage.control.feedforward_acceleration = 3.2 / 12.0;
    of_stage.control.feedforward_velocity = 25.0 / 12.0;
    of_stage.homing_velocity = search;
    of_stage.homing.creep = 5e-3;
  }
  void bring_up() {
    axis = std::make_unique<support::WiredAxis>(of_world, of_stage);
    axis->wired.add(axis->world);
    axis->wired.add(axis->stage);
    axis->wired.join(axis->world, "index_x", axis->stage, "index");
    axis->wired.join(axis->world, "truth_x", ears, "truth");
    axis->wired.join(axis->stage, "notices", ears, "notices");
    axis->wired.start();
    axis->hand.set_now(axis->wired.now());
    for (int i = 0; i < 5; ++i) axis->wired.step();
    (void)ends(AXIS_COMMAND_ENABLE);
  }
  const AxisState& state() { return *axis->hand.state.latest(); }
  double truth() { return ears.truth.latest()->position(); }
  /// Whether the command ended at all; `done`, refused or tripped.
  bool ends(AxisCommandKind kind, double position = 0.0, double longest = 120.0) {
    axis->tell(kind, position);
    const auto id = axis->next - 1;
    for (const double until = axis->wired.time() + longest; axis->wired.time() < until;) {
      axis->wired.step();
      lowest = std::min(lowest, truth());
      highest = std::max(highest, truth());
      event::Notice notice;
      while (ears.notices.take(notice)) said = notice.text().c_str();
      if (state().command_id() == id && (state().command_done() || state().mode() == AXIS_MODE_FAULT))
        return true;
    }
    return false;
  }
  /// Stage coordinate minus where the carriage stands.
  double error() { return state().position() - truth(); }
};

/// Homes with these; the reason why it is not homed, "" where it is.
std::string homed(HomingAxis& axis) {
  axis.bring_up();
  EXPECT_TRUE(axis.ends(AXIS_COMMAND_HOME)) << "homing does not end";
  EXPECT_NE(axis.state().command_refused(), axis.state().homed());
  if (axis.state().homed()) return "";
  EXPECT_FALSE(axis.said.empty());
  EXPECT_NE(axis.state().mode(), AXIS_MODE_HOMING);
  return axis.said.empty() ? "no reason" : axis.said;
}

constexpr double close_to = 12e-6;  // a period of creep and the switch's own count, both ways

TEST(Homing, TakesTheEdgeOfTheHomeSwitchWhereverItStarts) {
  for (const bool positive : {false, true})
    for (const double start : {-1.5e-3, -1e-4, 1e-5, 1e-3, 0.05, 0.13, 0.1999, 0.2 + 1.5e-3}) {
      HomingAxis axis;
      axis.of_stage.homing.direction = positive ? "positive" : "negative";
      axis.of_world.x.ends.home_end = positive ? "high" : "low";
      axis.of_world.x.start = start;
      EXPECT_EQ(homed(axis), "") << start;
      EXPECT_LT(std::abs(axis.error()), close_to) << start << (positive ? " upwards" : "");
      ASSERT_TRUE(axis.ends(AXIS_COMMAND_MOVE, 0.1));
      EXPECT_NEAR(axis.truth(), 0.1, close_to);
    }
}

TEST(Homing, FindsACamFromBeyondIt) {
  HomingAxis axis;  // closed from -0.5 mm to -1 mm, the limit at -2 mm
  axis.of_world.x.ends.home_at = 5e-4;
  axis.of_world.x.ends.home_width = 5e-4;
  axis.of_world.x.start = -2.3e-3;
  EXPECT_EQ(homed(axis), "");
  EXPECT_LT(std::abs(axis.error() - 5e-4), close_to);
  HomingAxis between;
  between.of_world.x.ends = axis.of_world.x.ends;
  between.of_world.x.start = -1.6e-3;
  EXPECT_THAT(homed(between), HasSubstr("at the lower limit switch"));
  EXPECT_TRUE(between.ends(AXIS_COMMAND_HOME));  // again, from the limit
  EXPECT_TRUE(between.state().homed());
  EXPECT_LT(std::abs(between.error() - 5e-4), close_to);
}

TEST(Homing, TakesALimitSwitchThatIsTheHome) {
  for (const bool positive : {false, true})
    for (const double start : {-2.5e-3, 0.0, 0.1, 0.2025}) {
      HomingAxis axis;
      axis.of_stage.homing.method = "limit_switch";
      axis.of_stage.homing.direction = positive ? "positive" : "negative";
      axis.of_stage.homing.position = positive ? 0.202 : -0.002;
      axis.of_world.x.ends.home = "open";
      axis.of_world.x.start = start;
      EXPECT_EQ(homed(axis), "") << start;
      EXPECT_LT(std::abs(axis.error()), close_to) << start;
      EXPECT_GT(axis.truth(), -2e-3);  // off it again
      EXPECT_LT(axis.truth(), 0.202);
      ASSERT_TRUE(axis.ends(AXIS_COMMAND_MOVE, 0.1));
      EXPECT_NEAR(axis.truth(), 0.1, close_to);
    }
}

TEST(Homing, TakesTheFirstIndexPulseOffTheSwitchToTheCount) {
  for (const char* method : {"home_switch", "limit_switch"}) {
    HomingAxis axis;
    axis.of_stage.homing.method = method;
    axis.of_stage.homing.index = true;
    axis.of_stage.homing.position = 0.0;
    axis.of_world.x.ends.index_pitch = 0.02;
    axis.of_world.x.ends.index_at = 0.0123;
    axis.of_world.x.start = 0.1;
    EXPECT_EQ(homed(axis), "") << method;
    EXPECT_NEAR(axis.error(), -0.0123, 1e-6) << method;
  }
}

TEST(Homing, TakesAnIndexPulseAlone) {
  HomingAxis axis;
  axis.of_stage.homing.method = "index_pulse";
  axis.of_stage.homing.position = 0.08;
  axis.of_world.x.ends.index_pitch = 1.0;
  axis.of_world.x.ends.index_at = 0.08;
  axis.of_world.x.start = 0.1;
  EXPECT_EQ(homed(axis), "");
  EXPECT_NEAR(axis.error(), 0.0, 1e-6);
  HomingAxis none;
  none.of_stage.homing = axis.of_stage.homing;
  none.of_world.x.start = 0.1;
  EXPECT_THAT(homed(none), HasSubstr("at the lower limit switch"));
}

TEST(Homing, TakesAHardStopByCurrentAndComesOffIt) {
  HomingAxis axis;
  axis.of_stage.homing.method = "hard_stop";
  axis.of_stage.homing.position = -5e-3;
  axis.of_world.x.ends.limit = "open";
  axis.of_world.x.start = 0.05;
  EXPECT_EQ(homed(axis), "");
  EXPECT_LT(std::abs(axis.error()), close_to);
  EXPECT_NEAR(axis.truth(), -4e-3, 1e-4);
  HomingAxis dead;  // stands, and pushes: a stop like any other, but it does not come off it
  dead.of_stage.homing = axis.of_stage.homing;
  dead.of_world.x = axis.of_world.x;
  dead.of_world.x.motor_constant = 1e-3;
  EXPECT_THAT(homed(dead),
              ::testing::AnyOf(HasSubstr("drive or encoder is dead"), HasSubstr("following error")));
}

TEST(Homing, EachSwitchThatFailsEndsItWithItsReason) {
  struct Case {
    const char* what;
    void (*set)(HomingAxis&);
    const char* reason;
  };
  const Case cases[] = {
      {"stuck open", [](HomingAxis& a) { a.of_world.x.ends.home = "open"; }, "at the lower limit switch"},
      {"stuck closed", [](HomingAxis& a) { a.of_world.x.ends.home = "closed"; }, "at the upper limit switch"},
      {"inverted", [](HomingAxis& a) { a.of_world.x.ends.home = "inverted"; }, "at the upper limit switch"},
      {"at the other end", [](HomingAxis& a) { a.of_world.x.ends.home_end = "high"; },
       "at the lower limit switch"},
      {"both limits", [](HomingAxis& a) { a.of_world.x.ends.limit = "closed"; },
       "both limit switches are closed"},
      {"no switch, no limits, no stops",
       [](HomingAxis& a) {
         a.of_world.x.ends.home = a.of_world.x.ends.limit = "open";
         a.of_world.x.ends.stops = 1.0;
       },
       "no home switch within 210 mm"},
      {"no switch, no limits",
       [](HomingAxis& a) { a.of_world.x.ends.home = a.of_world.x.ends.limit = "open"; }, "following error"},
      {"a drive that does not move", [](HomingAxis& a) { a.of_world.x.motor_constant = 1e-3; },
       "following error"},
      {"edges that differ",
       [](HomingAxis& a) {
         a.of_world.x.ends.bounce = 0.03;  // 150 um at the creep velocity
         a.of_stage.homing.debounce = 1e-3;
         a.of_stage.homing.tolerance = 1e-7;
       },
       "mm apart; `homing.tolerance` is"},
  };
  for (const Case& one : cases) {
    HomingAxis axis;
    axis.of_world.x.start = 0.1;
    one.set(axis);
    EXPECT_THAT(homed(axis), HasSubstr(one.reason)) << one.what;
    if (axis.of_world.x.ends.limit == "works") {
      EXPECT_GT(axis.lowest, low - 2e-3 - braking) << one.what;
      EXPECT_LT(axis.highest, high + 2e-3 + braking) << one.what;
    }
  }
}

TEST(Homing, ASwitchThatBouncesIsTakenAtItsEdge) {
  for (const double bounce : {1e-3, 2e-3, 4e-3}) {
    HomingAxis axis;
    axis.of_world.x.ends.bounce = bounce;
    axis.of_world.x.start = 0.03;
    EXPECT_EQ(homed(axis), "");
    EXPECT_LT(std::abs(axis.error()), close_to + bounce * axis.of_stage.homing.creep);
  }
}

// Whatever fails, from wherever: it ends, never `homed` at a wrong place, never driven past a limit that closes.
TEST(Homing, NoFaultHomesAnAxisAtAWrongPlace) {
  const auto seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random{seed};
  const auto between = [&](double a, double b) { return std::uniform_real_distribution{a, b}(random); };
  const auto any = [&](std::initializer_list<const char*> of) {
    return std::string{of.begin()[random() % of.size()]};
  };
  const int runs =
      std::getenv("INVAR_HOMING_RUNS") != nullptr ? std::atoi(std::getenv("INVAR_HOMING_RUNS")) : 60;
  int well = 0;
  for (int i = 0; i < runs; ++i) {
    HomingAxis axis;
    auto& ends = axis.of_world.x.ends;
    auto& homing = axis.of_stage.homing;
    homing.direction = any({"negative", "positive"});
    ends.home_end = any({"low", "high"});
    ends.home = any({"works", "works", "works", "open", "closed", "inverted"});
    ends.limit = any({"works", "works", "works", "open"});
    ends.home_at = random() % 2 == 0 ? 0.0 : between(-0.06, 1.5e-3);
    const bool cam = ends.home_at < 0.0;
    if (cam) ends.home_width = between(1e-3, 5e-3);
    ends.bounce = random() % 2 == 0 ? 0.0 : between(0.0, 4e-3);
    axis.of_world.x.start = between(low - 2.5e-3, high + 2.5e-3);
    if (random() % 12 == 0) axis.of_world.x.motor_constant = 1e-3;
    const std::string why = homed(axis);
    SCOPED_TRACE(::testing::Message()
                 << "run " << i << ": " << homing.direction << ", switch " << ends.home << " at "
                 << ends.home_end << " " << ends.home_at << " width " << ends.home_width << ", limits "
                 << ends.limit << ", bounce " << ends.bounce << ", start " << axis.of_world.x.start
                 << ", m/c " << axis.of_world.x.motor_constant << ": " << why);
    if (ends.limit == "works") {
      EXPECT_GT(axis.lowest, std::min(low - 2e-3, axis.of_world.x.start) - braking);
      EXPECT_LT(axis.highest, std::max(high + 2e-3, axis.of_world.x.start) + braking);
    }
    if (!why.empty()) continue;
    ++well;
    const bool positive = homing.direction == "positive";
    // A switch of the other end that lies inside the travel is approached on its other edge.
    const bool same_end = positive == (ends.home_end == "high");
    const double out = ends.home_end == "high" ? 1.0 : -1.0, end = ends.home_end == "high" ? high : low;
    const double edge = same_end ? end + out * ends.home_at : end + out * (ends.home_at + ends.home_width);
    const double home = positive ? high : low;
    EXPECT_LT(std::abs(axis.error() - (home - edge)), 40e-6);
  }
  EXPECT_GT(well, runs / 10);
}

TEST(Homing, NeitherAllocatesNorLocks) {
  for (const char* method : {"home_switch", "limit_switch", "hard_stop"}) {
    HomingAxis axis;
    axis.of_stage.homing.method = method;
    if (std::string{method} == "hard_stop") axis.of_world.x.ends.limit = "open";
    axis.of_world.x.start = 0.02;
    axis.bring_up();
    axis.axis->tell(AXIS_COMMAND_HOME);
    std::uint64_t violations = 0;
    for (int i = 0; i < 20'000 && !axis.state().homed(); ++i) {
      const support::RealTimeGuard guard;
      axis.axis->wired.step();
      violations += guard.violations();
    }
    EXPECT_EQ(violations, 0U) << method;
    EXPECT_TRUE(axis.state().homed()) << method;
  }
}

TEST(Stage, ALimitSwitchThatClosesStopsItAndOnlyMovesAwayAreTaken) {
  HomingAxis axis;
  axis.of_stage.absolute_encoder = true;
  axis.of_world.x.ends.incremental = false;
  axis.of_world.x.ends.limits = 0.0;  // it closes at the end of the travel, where a move may go
  axis.of_stage.travel = {low - 0.01, high + 0.01};
  axis.of_world.x.start = 0.15;
  axis.bring_up();
  ASSERT_TRUE(axis.ends(AXIS_COMMAND_MOVE, 0.2095));
  EXPECT_TRUE(axis.state().command_refused());
  EXPECT_EQ(axis.state().mode(), AXIS_MODE_HOLDING);
  EXPECT_THAT(axis.said, HasSubstr("upper limit switch is closed"));
  EXPECT_LT(axis.highest, high + 6e-3);
  const double stands = axis.truth();
  ASSERT_TRUE(axis.ends(AXIS_COMMAND_MOVE, 0.2099));
  EXPECT_TRUE(axis.state().command_refused());
  EXPECT_NEAR(axis.truth(), stands, 1e-5);
  ASSERT_TRUE(axis.ends(AXIS_COMMAND_MOVE, 0.1));
  EXPECT_FALSE(axis.state().command_refused());
  EXPECT_NEAR(axis.truth(), 0.1, 1e-5);
}

}  // namespace
}  // namespace invar::stage
