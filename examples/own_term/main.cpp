// An axis with a term of physics that the library does not have: it coasts, and its speed is compared with the closed form.
#include <core/physics/axis_plant.hpp>

#include <cmath>
#include <cstdio>

#include "eddy_current_brake.hpp"

namespace {

constexpr double mass = 2.0;        // kg
constexpr double peak = 4.0;        // N
constexpr double peak_speed = 0.1;  // m/s
constexpr double first_speed = 0.4;
constexpr double step = 1e-3;  // s

/// [s] The time from `first_speed` to `speed`: the integral of m dv / F(v).
double exact_time(double speed) {
  const auto primitive = [](double v) { return v * v / 2.0 + peak_speed * peak_speed * std::log(v); };
  return mass * (primitive(first_speed) - primitive(speed)) / (2.0 * peak * peak_speed);
}

}  // namespace

int main() {
  using namespace invar::physics;
  AxisPlant axis{
      {.mass = mass}, {AxisTerm{.kind = &EddyCurrentBrake::kind, .parameters = {peak, peak_speed}}}, step};
  axis.rest_at(0.0);
  axis.set_velocity(first_speed);
  std::printf("%s: %.*s\n", EddyCurrentBrake::info.name.data(),
              static_cast<int>(EddyCurrentBrake::info.description.size()),
              EddyCurrentBrake::info.description.data());
  double worst = 0.0;  // s
  for (const double speed : {0.3, 0.2, 0.1, 0.05}) {
    double before = axis.velocity();
    while (axis.velocity() > speed) {
      before = axis.velocity();
      axis.step(0.0, step);
    }
    const double time =
        axis.time() - step * (speed - axis.velocity()) / (before - axis.velocity());  // between two steps
    std::printf("%.2f m/s after %.3f s\n", speed, time);
    worst = std::fmax(worst, std::fabs(time - exact_time(speed)));
  }
  std::printf("the closed form differs by %s 0.1 ms\n", worst < 1e-4 ? "less than" : "more than");
  return worst < 1e-4 ? 0 : 1;
}
