// Three sensors of a sinusoid on the ports of a fusion.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>

#include "components/fusion/fusion.hpp"

namespace invar::fusion::testing {

/// Three sensors on ports: an encoder of 0.1 mm, an analogue position sensor and a velocity sensor, at a sinusoid.
struct Rig {
  struct Ends final : Component {
    Output<sensing::AxisReading> encoder{*this, "encoder"}, analogue{*this, "analogue"},
        speed{*this, "speed"};
    Input<sensing::FusedPosition> fused{*this, "fused"};
    void step(const Tick&) noexcept override {}
  };
  static Fusion::Parameters parameters_of() {
    Fusion::Parameters p;
    p.sensors.resize(3);
    p.sensors[0].name = "speed";  // the order does not matter: positions come first
    p.sensors[0].quantity = "velocity";
    p.sensors[0].largest = 0.13;
    p.sensors[0].delay_sigma = 5e-3;
    p.sensors[1].name = "encoder";
    p.sensors[1].resolution = 1e-4;
    p.sensors[2].name = "analogue";
    p.sensors[2].noise = 5e-5;
    return p;
  }
  explicit Rig(Fusion::Parameters p = parameters_of()) : parameters{std::move(p)}, fusion{parameters} {
    const auto join = [&](OutputPort& output, const char* port) {
      EXPECT_TRUE(output.connect(*static_cast<InputPort*>(fusion.find_port(port))));
    };
    join(ends.encoder, "sensor_encoder");
    join(ends.analogue, "sensor_analogue");
    join(ends.speed, "sensor_speed");
    EXPECT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
    fusion.configure();
    fusion.activate();
  }
  static double truth(double t) { return 0.1 * (1.0 - std::cos(omega * t)); }

  /// One period; `meddle` may change or drop (false) what a sensor (0 encoder, 1 analogue, 2 speed) says.
  using Meddle = std::function<bool(int sensor, double t, sensing::AxisReading& reading)>;
  const sensing::FusedPosition& step(const Meddle& meddle = {}) {
    const double t = static_cast<double>(cycle) * 1e-3;
    const Tick tick{Instant{cycle * 1'000'000}, 1e-3, static_cast<std::uint64_t>(cycle)};
    ends.set_now(tick.now);
    fusion.set_now(tick.now);
    sensing::AxisReading r;
    r.at().time_ns(tick.now.ns);
    const auto say = [&](int sensor, Output<sensing::AxisReading>& output) {
      if (!meddle || meddle(sensor, t, r)) output.write(r);
    };
    r.position(1e-4 * std::round(truth(t) / 1e-4));
    say(0, ends.encoder);
    r.at().time_ns(tick.now.ns);
    r.position(truth(t) + 5e-5 * noise(random));
    say(1, ends.analogue);
    r.at().time_ns(tick.now.ns);
    r.position(std::nan(""));
    r.velocity(0.1 * omega * std::sin(omega * (t - lag)) + 0.005 * noise(random));
    say(2, ends.speed);
    fusion.step(tick);
    ++cycle;
    return *ends.fused.latest();
  }
  [[nodiscard]] double time() const { return static_cast<double>(cycle) * 1e-3; }

  static constexpr double omega = 2.0 * std::numbers::pi / 5.0;
  Fusion::Parameters parameters;
  Fusion fusion;
  Ends ends;
  double lag = 0.0;
  std::mt19937 random{7};
  std::normal_distribution<double> noise{0.0, 1.0};
  std::int64_t cycle = 0;
};

}  // namespace invar::fusion::testing
