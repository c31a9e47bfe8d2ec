// Poles of the closed loop against the controller and the axis themselves, stepped from a small displacement.
#include "core/physics/axis_stability.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "core/physics/axis_plant.hpp"

namespace invar::physics {
namespace {

constexpr double mass = 3.2, motor_constant = 12.0, viscous_damping = 18.0;

/// How much further a swing reaches after many periods.
double growth(const AxisControllerSettings& settings) {
  AxisPlant plant{{mass, motor_constant, viscous_damping}, {}, 1.0 / settings.rate};
  AxisController controller{settings};
  plant.rest_at(1e-6);
  double largest = 0.0;
  for (int k = 0; k < 20000 && largest < 1e12; ++k) {
    const double y = plant.reading();
    plant.step(controller.step(0.0, y), 1.0 / settings.rate);
    if (k > 15000 || std::abs(y) > 1.0) largest = std::max(largest, std::abs(y));
  }
  return largest / 1e-6;
}

AxisControllerSettings scaled(AxisControllerSettings settings, double by) {
  settings.kp *= settings.kind == AxisControllerSettings::Kind::pid ? by : 1.0;
  settings.ki *= by, settings.kd *= by, settings.kv *= by;
  return settings;
}

TEST(AxisStability, BelowTheLargestGainALoopSettlesAndAboveItSwingsUp) {
  const auto seed = std::random_device{}();
  std::mt19937_64 random{seed};
  std::uniform_real_distribution<double> share{0.0, 1.0};
  const double inertia = mass / motor_constant, damping = viscous_damping / motor_constant;
  for (int i = 0; i < 30; ++i) {
    AxisControllerSettings s;
    s.rate = std::pow(10.0, 2.4 + 1.2 * share(random));
    const double bandwidth = s.rate * (0.05 + 0.1 * share(random));  // rad/s
    if (i % 4 != 0) s.velocity_filter_hz = s.rate * (0.1 + 0.4 * share(random));
    if (i % 3 == 0) {
      s.kind = AxisControllerSettings::Kind::cascade;
      s.kp = 0.3 * bandwidth, s.kv = inertia * bandwidth;
    } else {
      s.kp = 0.3 * inertia * bandwidth * bandwidth, s.kd = inertia * bandwidth;
      s.ki = i % 3 == 1 ? 0.02 * inertia * std::pow(bandwidth, 3) : 0.0;
    }
    double low = 1.0, high = 100.0;
    ASSERT_LT(spectral_radius(s, inertia, damping), 1.0) << "seed " << seed << ", loop " << i;
    ASSERT_GT(spectral_radius(scaled(s, high), inertia, damping), 1.0) << "seed " << seed << ", loop " << i;
    while (high - low > 1e-4 * low)
      (spectral_radius(scaled(s, 0.5 * (low + high)), inertia, damping) < 1.0 ? low : high) =
          0.5 * (low + high);
    EXPECT_LT(growth(scaled(s, 0.97 * low)), 0.1) << "seed " << seed << ", loop " << i << ", gain " << low;
    EXPECT_GT(growth(scaled(s, 1.03 * low)), 10.0) << "seed " << seed << ", loop " << i << ", gain " << low;
  }
}

TEST(AxisStability, AFreeCarriageWithoutGainsStaysWhereItIs) {
  EXPECT_NEAR(spectral_radius({}, 0.25, 0.0), 1.0, 1e-6);
  EXPECT_NEAR(spectral_radius({}, 0.25, 1.5), 1.0, 1e-6);
}

}  // namespace
}  // namespace invar::physics
