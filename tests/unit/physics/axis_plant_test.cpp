// The axis against closed forms.
#include "core/physics/axis_plant.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <new>
#include <numbers>

#include "core/physics/library.hpp"

namespace {
thread_local long allocations = 0;
}
void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc{};
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace invar::physics {
namespace {

AxisTerm term(std::string_view name, std::array<double, most_parameters> parameters) {
  return {axis_kind(*find_term(Plant::axis, name)), parameters, {}};
}

AxisTerm course(CurveActs acts, Curve curve) {
  return {axis_kind(*unmodelled(Plant::axis, "force")), {}, std::move(curve), acts};
}

TEST(AxisPlant, ApproachesItsTerminalSpeedLikeAFirstOrderLag) {
  AxisPlant axis{{2.0, 10.0, 4.0}, {}};
  for (int i = 0; i < 500; ++i) axis.step(1.0, 1e-3);
  const double t = 0.5, tau = 0.5, v = 2.5;
  EXPECT_NEAR(axis.velocity(), v * (1.0 - std::exp(-t / tau)), 1e-10);
  EXPECT_NEAR(axis.position(), v * (t - tau * (1.0 - std::exp(-t / tau))), 1e-10);
}

TEST(AxisPlant, AWaveInTheCurrentCountsBetweenTheCyclesOfItsController) {
  constexpr double frequency = 63.7, amplitude = 0.3, phase = 0.9, onset = 0.1, mass = 2.0, motor = 10.0;
  const double turns = 2.0 * std::numbers::pi * frequency;
  for (const double squareness : {0.0, 1.0}) {
    AxisPlant axis{{mass, motor, 0.0},
                   {term("additive_disturbance", {amplitude, frequency, phase, squareness, onset})}};
    const auto integral = [&](double t) {  // of the wave since its onset
      const auto up_to = [&](double angle) {
        return squareness > 0.5 ? std::acos(std::cos(angle)) : -std::cos(angle);  // a triangle
      };
      return (up_to(turns * t + phase) - up_to(turns * onset + phase)) / turns;
    };
    for (int i = 1; i <= 700; ++i) {
      axis.step(0.0, 1e-3);
      const double expected = i <= 100 ? 0.0 : motor * amplitude / mass * integral(i * 1e-3);
      ASSERT_NEAR(axis.velocity(), expected, 1e-9) << i << " squareness " << squareness;
    }
  }
}

TEST(AxisPlant, DryFrictionStopsAMassAfterTheWayOfItsEnergyAndHoldsIt) {
  AxisPlant axis{{2.0, 10.0, 0.0}, {term("coulomb_friction", {3.0})}};
  axis.set_velocity(0.2);
  for (int i = 0; i < 1000; ++i) axis.step(0.25, 1e-3);  // 2.5 N pushes, 3 N of friction holds
  EXPECT_EQ(axis.velocity(), 0.0);
  EXPECT_NEAR(axis.position(), 0.5 * 2.0 * 0.04 / 0.5, 1e-9);
  const double rest = axis.position();
  for (int i = 0; i < 100; ++i) axis.step(-0.29, 1e-3);
  EXPECT_EQ(axis.position(), rest);
  for (int i = 0; i < 100; ++i) axis.step(-0.31, 1e-3);  // 0.1 N more than friction
  EXPECT_NEAR(axis.position() - rest, -0.5 * 0.05 * 0.01, 1e-9);
}

TEST(AxisPlant, FrictionInOneStretchTakesItsEnergyThereWhereverTheCarriageComesFrom) {
  const Curve rough{"position", {0.1, 0.2, 0.3}, {0.0, 3.0, 0.0}};  // 0.3 J along the way
  for (const double way : {1.0, -1.0}) {
    AxisPlant axis{{2.0, 10.0, 0.0}, {course(CurveActs::as_friction, rough)}};
    axis.rest_at(way > 0.0 ? 0.0 : 0.4);
    axis.set_velocity(way);
    for (int i = 0; i < 1000; ++i) axis.step(0.0, 1e-3);
    EXPECT_NEAR(axis.velocity(), way * std::sqrt(1.0 - 0.3), 1e-6);
  }
  AxisPlant axis{{2.0, 10.0, 0.0}, {course(CurveActs::as_friction, rough)}};
  axis.rest_at(0.2);
  for (int i = 0; i < 100; ++i) axis.step(0.29, 1e-3);  // 2.9 N pushes, 3 N holds
  EXPECT_EQ(axis.position(), 0.2);
}

TEST(AxisPlant, DampingInOneStretchTakesItsAreaOverTheMassOfTheSpeed) {
  const Curve thick{"position", {0.1, 0.2, 0.3}, {0.0, 4.0, 0.0}};  // 0.4 N s along the way
  for (const double way : {1.0, -1.0}) {
    AxisPlant axis{{2.0, 10.0, 0.0}, {course(CurveActs::as_damping, thick)}};
    axis.rest_at(way > 0.0 ? 0.0 : 0.4);
    axis.set_velocity(way);
    for (int i = 0; i < 1000; ++i) axis.step(0.0, 1e-3);
    EXPECT_NEAR(axis.velocity(), way * 0.8, 1e-6);
  }
}

TEST(AxisPlant, WhatComesUponTheCarriageIsPushedAlong) {
  const Curve load{"time", {0.0, 0.5, 0.5 + 1e-9, 2.0}, {0.0, 0.0, 3.0, 3.0}};
  AxisPlant axis{{2.0, 10.0, 0.0}, {course(CurveActs::as_mass, load)}};
  for (int i = 0; i < 1000; ++i) axis.step(1.0, 1e-3);  // 10 N: 5 m/s2 for half a second, then 2 m/s2
  EXPECT_NEAR(axis.velocity(), 0.5 * 5.0 + 0.5 * 2.0, 2e-3);
}

TEST(AxisPlant, StribeckFrictionNeedsItsStaticForceToBreakAway) {
  AxisPlant axis{{1.0, 1.0, 0.0}, {term("stribeck_friction", {1.0, 2.0, 0.01})}};
  for (int i = 0; i < 100; ++i) axis.step(1.99, 1e-3);
  EXPECT_EQ(axis.position(), 0.0);
  for (int i = 0; i < 1000; ++i) axis.step(3.0, 1e-3);
  EXPECT_NEAR(axis.velocity(), 2.0, 0.02);  // far above 0.01 m/s only the Coulomb level is left
}

TEST(AxisPlant, BristlesBendLikeASpringAndKeepTheirHysteresis) {
  // Pushed very slowly by a stiff spring, the friction force is that of Dahl's closed form.
  const double level = 1.0, stiffness = 1e5;
  AxisPlant axis{{0.01, 1.0, 50.0},
                 {term("presliding_friction", {level, stiffness}), term("position_stiffness", {0.0, 0.0})}};
  for (int i = 0; i < 4000; ++i) axis.step(0.5 * (1.0 - std::exp(-i / 400.0)), 1e-3);
  // Held by 0.5 N: level (1 - exp(-x stiffness / level)) = 0.5
  EXPECT_NEAR(axis.position(), std::numbers::ln2 * level / stiffness, 2e-8);
  for (int i = 0; i < 4000; ++i) axis.step(0.5 * std::exp(-i / 400.0), 1e-3);
  // Let go, it does not come all the way back: that is the hysteresis.
  EXPECT_NEAR(axis.position(), (std::numbers::ln2 - std::log(1.5)) * level / stiffness, 5e-8);
}

TEST(AxisPlant, ATransportDelayShiftsTheMotionByExactlyTheDelay) {
  const double delay = 2.3e-3;
  AxisPlant late{{2.0, 10.0, 0.0}, {term("transport_delay", {delay})}};
  for (int i = 0; i < 200; ++i) late.step(1.0, 1e-3);
  EXPECT_NEAR(late.position(), 0.5 * 5.0 * std::pow(0.2 - delay, 2), 1e-12);
  EXPECT_NEAR(late.velocity(), 5.0 * (0.2 - delay), 1e-12);
}

TEST(AxisPlant, AMeasurementDelayShowsWhereTheCarriageWas) {
  const double delay = 1.7e-3;
  AxisPlant late{{2.0, 10.0, 0.0}, {term("measurement_delay", {delay})}};
  for (int i = 0; i < 200; ++i) late.step(1.0, 1e-3);
  EXPECT_NEAR(late.reading(), 0.5 * 5.0 * std::pow(0.2 - delay, 2), 1e-10);
}

TEST(AxisPlant, AnAmplifierLagLosesTheMomentumOfItsTimeConstant) {
  const double tau = 3e-4;
  AxisPlant slow{{2.0, 10.0, 0.0}, {term("amplifier_lag", {tau})}};
  for (int i = 0; i < 200; ++i) slow.step(1.0, 1e-3);
  EXPECT_NEAR(slow.velocity(), 5.0 * (0.2 - tau), 1e-9);
  EXPECT_NEAR(slow.position(), 5.0 * (0.02 - tau * 0.2 + tau * tau), 1e-7);
}

TEST(AxisPlant, ADeadZoneTakesItsWidthFromEachSide) {
  AxisPlant axis{{1.0, 1.0, 0.0}, {term("dead_zone", {0.02})}};
  for (int i = 0; i < 100; ++i) axis.step(0.02, 1e-3);
  EXPECT_EQ(axis.position(), 0.0);
  for (int i = 0; i < 100; ++i) axis.step(-0.05, 1e-3);
  EXPECT_NEAR(axis.velocity(), -0.003, 1e-12);
}

TEST(AxisPlant, BacklashStandsStillForItsWholeWidthAfterAReversal) {
  AxisPlant axis{{1.0, 1.0, 0.0}, {term("backlash", {1e-3})}};
  axis.set_velocity(0.01);
  for (int i = 0; i < 1000; ++i) axis.step(0.0, 1e-3);
  EXPECT_NEAR(axis.reading(), 0.01 - 0.5e-3, 1e-9);
  axis.set_velocity(-0.01);
  for (int i = 0; i < 90; ++i) axis.step(0.0, 1e-3);
  EXPECT_NEAR(axis.reading(), 0.01 - 0.5e-3, 1e-9);
  for (int i = 0; i < 110; ++i) axis.step(0.0, 1e-3);
  EXPECT_NEAR(axis.reading(), 0.01 - 2e-3 + 0.5e-3, 1e-9);
}

TEST(AxisPlant, AFlexibleModeRingsAtItsFreeFrequencyAndKeepsTheMomentum) {
  const double share = 0.2, f = 40.0, mass = 5.0;
  AxisPlant axis{{mass, 1.0, 0.0}, {term("flexible_mode", {share, f, 1e-4})}};
  axis.step(100.0, 1e-3);  // a knock of 0.1 N s
  const double drift = 0.1 / mass, from = axis.time();
  int crossings = 0;
  double last = axis.velocity() - drift, first_time = 0.0, last_time = 0.0;
  for (int i = 0; i < 4000; ++i) {
    axis.step(0.0, 2.5e-4);
    const double now = axis.velocity() - drift;
    if (last < 0.0 && now >= 0.0) {
      const double when = axis.time() - 2.5e-4 * now / (now - last);
      if (crossings++ == 0) first_time = when;
      last_time = when;
    }
    last = now;
  }
  EXPECT_GT(from, 0.0);
  EXPECT_NEAR((crossings - 1) / (last_time - first_time), f / std::sqrt(1.0 - share), 0.05);
}

TEST(AxisPlant, SteppingNeverAllocates) {
  std::vector<AxisTerm> all;
  for (const auto* info : terms_of(Plant::axis)) {
    AxisTerm one{axis_kind(*info), {}, {}};
    for (std::size_t i = 0; i < info->parameter_count(); ++i)
      one.parameters[i] = info->parameters[i].starts[0];
    all.push_back(one);
  }
  AxisPlant axis{{2.0, 10.0, 4.0}, all};
  const long before = allocations;
  double sum = 0.0;
  for (int i = 0; i < 1000; ++i) {
    axis.step(std::sin(0.01 * i), 1e-3);
    sum += axis.reading();
  }
  EXPECT_EQ(allocations, before);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace invar::physics
