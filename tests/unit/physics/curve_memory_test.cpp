// Curves with memory against closed forms, and in an axis and in equations against the same written out as states.
#include "core/physics/curve_memory.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/physics/axis_plant.hpp"
#include "core/physics/library.hpp"

namespace invar::physics {
namespace {

Curve curve_of(Curve::Memory memory, std::vector<double> knots, std::vector<double> values) {
  Curve curve{"position", std::move(knots), std::move(values)};
  curve.memory = memory;
  return curve;
}

TEST(CurveMemory, TheLoopOfAStopHasTheAreaOfItsSlip) {
  const auto curve = curve_of(Curve::Memory::stop, {0.1, 0.4}, {3.0, 5.0});
  CurveMemory memory;
  memory.start(curve, 0.0);
  constexpr double amplitude = 1.0;
  constexpr int steps = 20000;
  double work = 0.0, x = 0.0;
  for (int k = 1; k <= 3 * steps; ++k) {
    const double next = amplitude * std::sin(2.0 * M_PI * k / steps);
    const double before = memory.value(curve, x, 0.0);
    memory.advance(curve, next, 0.0);
    if (k > 2 * steps) work += 0.5 * (before + memory.value(curve, next, 0.0)) * (next - x);
    x = next;
  }
  // Each element slips over all of the way but twice its bend, at each turn.
  EXPECT_NEAR(work, 4.0 * (3.0 * (amplitude - 0.1) + 5.0 * (amplitude - 0.4)), 1e-3);
}

TEST(CurveMemory, AStopIsASpringUntilItSlips) {
  const auto curve = curve_of(Curve::Memory::stop, {0.2}, {4.0});
  CurveMemory memory;
  memory.start(curve, 1.0);
  EXPECT_DOUBLE_EQ(memory.value(curve, 1.1, 0.0), 2.0);
  EXPECT_DOUBLE_EQ(memory.value(curve, 1.5, 0.0), 4.0);
  memory.advance(curve, 1.5, 0.0);
  EXPECT_DOUBLE_EQ(memory.value(curve, 1.3, 0.0), 0.0);
  memory.go_on_from(7.0);  // somewhere else, still bent
  EXPECT_DOUBLE_EQ(memory.value(curve, 7.0, 0.0), 4.0);
}

TEST(CurveMemory, ARelaxationForgetsWithItsTimeConstants) {
  const auto curve = curve_of(Curve::Memory::relaxation, {0.5, 2.0}, {3.0, 5.0});
  CurveMemory memory;
  memory.start(curve, 0.0);
  memory.advance(curve, 1.0, 0.0);  // a jump
  for (double t = 0.1; t < 3.0; t += 0.1) {
    memory.advance(curve, 1.0, 0.1);
    EXPECT_NEAR(memory.value(curve, 1.0, 0.0), 3.0 * std::exp(-t / 0.5) + 5.0 * std::exp(-t / 2.0), 1e-12);
  }
  memory.start(curve, 0.0);
  constexpr double speed = 0.2;
  memory.advance(curve, speed * 4.0, 4.0);  // a ramp in one step
  EXPECT_NEAR(memory.value(curve, speed * 4.0, 0.0),
              speed * (3.0 * 0.5 * (1.0 - std::exp(-4.0 / 0.5)) + 5.0 * 2.0 * (1.0 - std::exp(-4.0 / 2.0))),
              1e-12);
}

/// A carriage of 2 kg pushed by a sine, held by a relaxing spring, in small steps of Euler's rule.
double pushed_carriage(double until) {
  double x = 0.0, v = 0.0, z = 0.0;
  constexpr double h = 1e-6;
  for (double t = 0.0; t < until - 0.5 * h; t += h) {
    const double force =
        10.0 * std::sin(20.0 * (std::floor(t * 1000.0 + 1e-6) / 1000.0)) - 900.0 * (x - z) - 4.0 * v;
    v += h * force / 2.0;
    x += h * v;
    z += h * (x - z) / 0.15;
  }
  return x;
}

TEST(CurveMemory, AnAxisIsHeldByWhatRelaxes) {
  const TermInfo& info = *unmodelled(Plant::axis, "force");
  AxisTerm term{axis_kind(info), {}, curve_of(Curve::Memory::relaxation, {0.15}, {-900.0})};
  AxisPlant plant{{2.0, 10.0, 4.0}, {term}};
  for (int k = 0; k < 700; ++k) plant.step(std::sin(20.0 * k / 1000.0), 1e-3);
  const double truth = pushed_carriage(0.7);
  EXPECT_NEAR(plant.position(), truth, 2e-4 * std::abs(truth));
}

}  // namespace
}  // namespace invar::physics
