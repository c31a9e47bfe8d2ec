#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics {

namespace {

constexpr double air_density = 1.19, air_viscosity = 1.82e-5;  // 20 degC, 1013 hPa
constexpr double drop_density = 998.0, gravity = 9.81;

/// [1/s] by which the speed relative to the air falls.
double drag_rate(double speed, double diameter) {
  const double reynolds = air_density * speed * diameter / air_viscosity;
  const double stokes = 18.0 * air_viscosity / (drop_density * diameter * diameter);
  return stokes * (1.0 + 0.15 * std::pow(reynolds, 0.687));
}

}  // namespace

Landing landing(const Droplet& d, double slope_x, double slope_y) {
  const double speed = d.speed * d.speed_factor;
  const double carried_x = d.carried ? d.stage_x : 0.0, carried_y = d.carried ? d.stage_y : 0.0;
  const double along_x = d.stage_x * d.delay, along_y = d.stage_y * d.delay;
  if (!(d.diameter > 0.0)) {
    const double t = d.height / speed;
    return {along_x + d.height * slope_x + carried_x * t + 0.5 * d.pull_x * t * t,
            along_y + d.height * slope_y + carried_y * t + 0.5 * d.pull_y * t * t};
  }
  // Runge-Kutta on the speeds; steps short against the flight and the braking time.
  struct State {
    double x, y, z, u, v, w;
  };
  const auto slope = [&](const State& s) {
    const double rate = drag_rate(std::sqrt(s.u * s.u + s.v * s.v + s.w * s.w), d.diameter);
    return State{s.u, s.v, s.w, d.pull_x - rate * s.u, d.pull_y - rate * s.v, gravity - rate * s.w};
  };
  const auto moved = [](const State& s, const State& by, double h) {
    return State{s.x + h * by.x, s.y + h * by.y, s.z + h * by.z,
                 s.u + h * by.u, s.v + h * by.v, s.w + h * by.w};
  };
  State s{along_x, along_y, 0.0, carried_x + speed * slope_x, carried_y + speed * slope_y, speed};
  const double h = std::min(d.height / speed / 8.0, 0.25 / drag_rate(speed, d.diameter));
  for (int i = 0; i < 2000; ++i) {
    const State a = slope(s);
    if (std::abs(a.w) < 1e-3 * gravity) {  // falls steadily from here on, however far it is
      const double rate = (gravity - a.w) / s.w, t = (d.height - s.z) / s.w,
                   fades = -std::expm1(-rate * t) / rate;
      return {s.x + d.pull_x / rate * (t - fades) + s.u * fades,
              s.y + d.pull_y / rate * (t - fades) + s.v * fades};
    }
    const State b = slope(moved(s, a, 0.5 * h)), c = slope(moved(s, b, 0.5 * h)), e = slope(moved(s, c, h));
    const State next = moved(moved(moved(moved(s, a, h / 6.0), b, h / 3.0), c, h / 3.0), e, h / 6.0);
    if (next.z >= d.height) {
      // The rest of the way with the speed at hand, to second order.
      const double rest = d.height - s.z;
      double t = rest / s.w;
      t = rest / (s.w + 0.5 * a.w * t);
      return {s.x + t * (s.u + 0.5 * a.u * t), s.y + t * (s.v + 0.5 * a.v * t)};
    }
    s = next;
  }
  return {s.x, s.y};
}

}  // namespace invar::physics
