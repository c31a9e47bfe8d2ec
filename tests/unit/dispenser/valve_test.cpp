// The valve in the loop: when it opens against closed forms of x(t), and everything that it refuses.
#include "components/dispenser/valve.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "tests/support/real_time_guard.hpp"
#include "tests/unit/dispenser/valve_bench.hpp"

namespace invar::dispenser {
namespace {

using namespace dispensing;
using testing::Bench;

TEST(Crossing, HasTheWorkedNumber) {
  const Motion motion{{0.0, 0.0}, {0.072, 0.0}, {0.0, 0.0}};
  const auto passed = crossing(motion, {0.010, 3e-6}, 0.010);
  ASSERT_TRUE(passed);
  EXPECT_NEAR(passed->time, 0.12888888888888889, 1e-15);
  EXPECT_NEAR(passed->beside, 3e-6, 1e-15);
}

TEST(Crossing, SolvesTheParabolaOfABrakingStage) {
  // x + lead v = 0.05 t - t^2 + 0.01 (0.05 - 2 t) = 0.0006 at the smaller root of t^2 - 0.03 t + 0.0001 = 0.
  const Motion motion{{0.0, 0.0}, {0.05, 0.0}, {-2.0, 0.0}};
  const auto passed = crossing(motion, {0.0006, 0.0}, 0.010);
  ASSERT_TRUE(passed);
  EXPECT_NEAR(passed->time, 0.015 - std::sqrt(0.015 * 0.015 - 0.0001), 1e-12);
  EXPECT_FALSE(crossing(motion, {0.0009, 0.0}, 0.010));  // turns back before
  EXPECT_FALSE(crossing({{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}}, {0.0, 0.0}, 0.0));
}

TEST(Valve, OpensInsideTheCycleWhereAStageOfConstantVelocityPassesItsPoint) {
  Bench bench;
  bench.bring_up();
  const std::vector<double> aims{0.0023456789, 0.0041, 0.0077777};
  const double lead = 0.0101;
  bench.load(aims, lead);
  bench.run(200);
  const auto jetted = bench.all_jetted();
  ASSERT_EQ(jetted.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const double truth = aims[i] / 0.05 - lead;  // 0.05 t + 0.05 lead = aim
    EXPECT_NEAR(static_cast<double>(jetted[i].at().time_ns()) * 1e-9, truth, 1.5e-9);
    EXPECT_NEAR(jetted[i].position()[0], 0.05 * truth, 1e-10);
    EXPECT_NEAR(jetted[i].velocity()[0], 0.05, 1e-15);
    EXPECT_EQ(jetted[i].target()[0], aims[i]);
    EXPECT_EQ(jetted[i].pressure(), 67e3);
  }
  ValvePulse pulse;
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(bench.pulses.take(pulse));
    EXPECT_EQ(pulse.open_ns(), jetted[i].at().time_ns());
    EXPECT_EQ(pulse.pulse_ns(), 180'000);
    EXPECT_EQ(pulse.spike_ns(), 100'000);
    EXPECT_GE(pulse.open_ns() - pulse.at().time_ns(), 1'000'000);  // `ahead`
    EXPECT_LT(pulse.open_ns() - pulse.at().time_ns(), 2'000'000);
  }
  EXPECT_FALSE(bench.pulses.take(pulse));
  EXPECT_EQ(bench.state.latest()->jetted(), 3U);
}

TEST(Valve, LeadsByTheVelocityThatTheStageHasThen) {
  // A sine: velocity between 0.05 and 0 m/s. Truth by bisection of x(t) + lead x'(t) = aim.
  constexpr double omega = 2.0 * std::numbers::pi / 1.2, amplitude = 0.05 / omega, lead = 0.008;
  Bench bench;
  bench.parameters.velocity = {1e-3, 0.1};
  bench.x = [](double t) {
    return Bench::Axis{amplitude * std::sin(omega * t), amplitude * omega * std::cos(omega * t),
                       -amplitude * omega * omega * std::sin(omega * t)};
  };
  bench.bring_up();
  const std::vector<double> aims{0.001, 0.003, 0.005, 0.007, 0.009};
  bench.load(aims, lead);
  bench.run(290);
  const auto jetted = bench.all_jetted();
  ASSERT_EQ(jetted.size(), aims.size());
  for (std::size_t i = 0; i < aims.size(); ++i) {
    double low = 0.0, high = 0.25;
    for (int k = 0; k < 100; ++k) {
      const double t = 0.5 * (low + high);
      const auto at = bench.x(t);
      (at.position + lead * at.velocity < aims[i] ? low : high) = t;
    }
    // Up to 2 ms ahead the jerk of 1.4 m/s3 changes lead times velocity by 22 nm: 0.5 us at 50 mm/s.
    const double opened = static_cast<double>(jetted[i].at().time_ns()) * 1e-9;
    EXPECT_NEAR(opened, low, 1e-6);
    const auto at = bench.x(opened);
    EXPECT_NEAR(at.position + lead * at.velocity, aims[i], 25e-9);
  }
}

TEST(Valve, CountsPlacesWithoutTheCorrectionThatTheServoAdds) {
  Bench bench;
  bench.correction = 37e-6;
  bench.bring_up();
  bench.load({0.003});
  bench.run(100);
  const auto jetted = bench.all_jetted();
  ASSERT_EQ(jetted.size(), 1U);
  EXPECT_NEAR(static_cast<double>(jetted[0].at().time_ns()) * 1e-9, 0.06, 2e-9);
  EXPECT_NEAR(jetted[0].position()[0], 0.003, 1e-10);
}

TEST(Valve, JetsEachPointOnceAlsoOnTheWayBack) {
  Bench bench;
  bench.x = [](double t) {
    return t < 0.1 ? Bench::Axis{0.05 * t, 0.05, 0.0} : Bench::Axis{0.005 - 0.05 * (t - 0.1), -0.05, 0.0};
  };
  bench.bring_up();
  bench.load({0.002, 0.003});
  bench.run(250);
  EXPECT_EQ(bench.all_jetted().size(), 2U);
  EXPECT_THAT(bench.reasons(), ::testing::IsEmpty());
}

TEST(Valve, NeitherAllocatesNorLocks) {
  Bench bench;
  bench.bring_up();
  std::vector<double> aims(2000);
  for (std::size_t i = 0; i < aims.size(); ++i) aims[i] = 0.001 + 6e-5 * static_cast<double>(i);
  bench.load(aims);
  bench.run(10);
  const support::RealTimeGuard guard;
  bench.run(1000);
  EXPECT_EQ(guard.violations(), 0U);
  EXPECT_GT(bench.state.latest()->jetted(), 700U);
}

// Everything that it refuses: the droplet is not jetted, and the event says why.
struct Fault {
  std::string name;
  std::function<void(Bench&)> make;
  RefusalReason reason;
};
class ValveRefuses : public ::testing::TestWithParam<Fault> {};

TEST_P(ValveRefuses, AndSaysWhy) {
  Bench bench;
  bench.degrees = 25.0;
  bench.bring_up();
  bench.load({0.001, 0.003});
  bench.run(40);  // the first is jetted
  GetParam().make(bench);
  bench.run(400);
  bench.send(TRIGGER_DISARM);
  bench.run(1);
  EXPECT_EQ(bench.all_jetted().size(), 1U);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(GetParam().reason));
  ValvePulse pulse;
  EXPECT_TRUE(bench.pulses.take(pulse));
  EXPECT_FALSE(bench.pulses.take(pulse));
}

const std::vector<Fault> faults{
    {"PressureOutOfBand", [](Bench& b) { b.air.in_band(false); }, REFUSED_PRESSURE},
    {"PressureSwitchedOff", [](Bench& b) { b.air.enabled(false); }, REFUSED_PRESSURE},
    {"PressureReportedStale", [](Bench& b) { b.air.stale(true); }, REFUSED_PRESSURE_STALE},
    {"ColdNozzle", [](Bench& b) { b.degrees = 5.0; }, REFUSED_TEMPERATURE},
    {"HotNozzle", [](Bench& b) { b.degrees = 70.0; }, REFUSED_TEMPERATURE},
    {"StageNotEnabled", [](Bench& b) { b.stage_ready = false; }, REFUSED_STAGE_NOT_READY},
    {"StageTooFast",
     [](Bench& b) { b.x = [](double t) {
                      return Bench::Axis{0.15 * (t - 0.03), 0.15, 0.0};
                    }; },
     REFUSED_VELOCITY},
    {"StageTooSlow",
     [](Bench& b) { b.x = [](double t) {
                      return Bench::Axis{0.0028 + 8e-4 * (t - 0.04), 8e-4, 0.0};
                    }; },
     REFUSED_VELOCITY},
    {"StageSilent", [](Bench& b) { b.stage_speaks = false; }, REFUSED_NOT_PASSED},
    {"PathBesideThePoint", [](Bench& b) { b.x = [](double) {
                                            return Bench::Axis{0.0025, 0.0, 0.0};
                                          }; },
     REFUSED_NOT_PASSED},
};
INSTANTIATE_TEST_SUITE_P(When, ValveRefuses, ::testing::ValuesIn(faults),
                         [](const auto& fault) { return fault.param.name; });

TEST(Valve, RefusesWhenThePressureIsNoLongerReported) {
  Bench bench;
  bench.bring_up();
  bench.load({0.001, 0.030});
  bench.run(40);
  bench.pressure_speaks = false;
  bench.run(700);  // the second is due 580 ms later
  EXPECT_EQ(bench.all_jetted().size(), 1U);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_PRESSURE_STALE));
}

TEST(Valve, RefusesDropletsThatAreDueFasterThanItCan) {
  Bench bench;
  bench.parameters.most_rate = 500.0;
  bench.bring_up();
  bench.load({0.001, 0.00105, 0.00120});  // 1 ms and 4 ms later
  bench.run(100);
  EXPECT_EQ(bench.all_jetted().size(), 2U);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_TOO_FAST));
}

TEST(Valve, RefusesOnTimesAtWhichItDoesNotWork) {
  Bench bench;
  bench.bring_up();
  TriggerPattern sample;
  sample.id(7);
  TriggerPoint point;
  point.position({0.001, 0.0, 0.002});
  point.pulse_ns(90'000);
  sample.points().push_back(point);
  bench.pattern.write(sample);
  bench.send(TRIGGER_ARM);
  bench.run(100);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_PULSE));
}

TEST(Valve, DoesNothingForAPatternThatIsNotArmedOrAnother) {
  Bench bench;
  bench.bring_up();
  bench.load({0.002});
  bench.run(5);
  bench.send(TRIGGER_DISARM);
  bench.run(100);
  EXPECT_THAT(bench.all_jetted(), ::testing::IsEmpty());
  TriggerCommand other;
  other.kind(TRIGGER_ARM);
  other.pattern_id(8);
  bench.command.write(other);
  bench.run(1);
  EXPECT_FALSE(bench.state.latest()->armed());
}

TEST(Valve, JetsByCommandOnlyOverTheArmedPattern) {
  Bench bench;
  bench.x = [](double) { return Bench::Axis{0.0025, 0.0, 0.0}; };
  bench.bring_up();
  bench.send(TRIGGER_JET_NOW);
  bench.run(1);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_NOT_ARMED));
  bench.load({0.002, 0.003});
  bench.run(1);
  bench.send(TRIGGER_JET_NOW);
  bench.run(1);
  EXPECT_EQ(bench.all_jetted().size(), 1U);
  bench.x = [](double) { return Bench::Axis{0.05, 0.0, 0.0}; };
  bench.send(TRIGGER_JET_NOW);
  bench.run(1);
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_OUTSIDE_PATTERN));
}

TEST(Valve, AnInactiveOneForgetsThatItWasArmed) {
  Bench bench;
  bench.bring_up();
  bench.load({0.002});
  bench.run(5);
  bench.valve->deactivate();
  bench.valve->activate();
  bench.run(100);
  EXPECT_THAT(bench.all_jetted(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace invar::dispenser
