#include "components/world/simulated_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace invar::world {
namespace {

struct Ends final : Component {
  Output<sensing::AxisReading> truth{*this, "truth"};
  Input<sensing::AxisReading> reading{*this, "reading"};
  void step(const Tick&) noexcept override {}
};

struct Shown {
  double time, value, stamp;
};

constexpr double dt = 1e-3;
double position(double t) { return 0.05 * t + 0.01 * t * t; }

/// What the sensor shows of a carriage that accelerates, over `duration`; only fresh readings.
std::vector<Shown> run(const SimulatedSensor::Parameters& parameters, double duration) {
  SimulatedSensor sensor{parameters};
  Ends ends;
  EXPECT_TRUE(ends.truth.connect(*static_cast<InputPort*>(sensor.find_port("truth"))));
  EXPECT_TRUE(static_cast<OutputPort*>(sensor.find_port("reading"))->connect(ends.reading));
  sensor.activate();
  std::vector<Shown> shown;
  std::uint64_t received = 0;
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(duration / dt); ++k) {
    const double t = static_cast<double>(k) * dt;
    const Tick tick{Instant{k * 1'000'000}, dt, static_cast<std::uint64_t>(k)};
    sensing::AxisReading truth;
    truth.position(position(t));
    truth.velocity(0.05 + 0.02 * t);
    ends.truth.write(truth);
    sensor.set_now(tick.now);
    sensor.step(tick);
    if (ends.reading.received() == std::exchange(received, ends.reading.received())) continue;
    const auto& reading = *ends.reading.latest();
    shown.push_back({t, parameters.quantity == "position" ? reading.position() : reading.velocity(),
                     static_cast<double>(reading.at().time_ns()) * 1e-9});
  }
  return shown;
}

TEST(SimulatedSensor, HasTheNoiseOfItsLevel) {
  SimulatedSensor::Parameters parameters;
  parameters.quantity = "velocity";
  parameters.noise_level = 0.2;
  parameters.largest = 0.3;
  double squares = 0.0;
  double most = 0.0;
  const auto shown = run(parameters, 20.0);
  for (const Shown& s : shown) {
    const double noise = s.value - (0.05 + 0.02 * s.time);
    squares += noise * noise;
    most = std::max(most, std::abs(noise));
  }
  // Uniform: its largest value is the level, its deviation that over sqrt(3).
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(shown.size())), 0.06 / std::sqrt(3.0), 1e-3);
  EXPECT_LE(most, 0.06);
  EXPECT_GT(most, 0.0595);
}

TEST(SimulatedSensor, IsSilentBetweenItsReadings) {
  SimulatedSensor::Parameters parameters;
  parameters.interval = 0.005;
  const auto shown = run(parameters, 1.0);
  ASSERT_EQ(shown.size(), 200U);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    EXPECT_NEAR(shown[i].time, 0.005 * static_cast<double>(i), 1e-9);
    EXPECT_NEAR(shown[i].value, position(shown[i].time), 1e-12);
  }
}

TEST(SimulatedSensor, FailsAsItIsTold) {
  SimulatedSensor::Parameters parameters;
  const auto value_at = [&](const char* kind, double size, double t) -> std::vector<Shown> {
    parameters.faults = {{kind, 0.5, 0.2, size}};
    std::vector<Shown> found;
    for (const Shown& s : run(parameters, 1.0))
      if (std::abs(s.time - t) < 1e-6) found.push_back(s);
    return found;
  };
  EXPECT_EQ(value_at("dead", 0.0, 0.6).at(0).value, 0.0);
  EXPECT_NEAR(value_at("stuck", 0.0, 0.6).at(0).value, position(0.499), 1e-12);
  EXPECT_TRUE(value_at("missing", 0.0, 0.6).empty());
  EXPECT_NEAR(value_at("jump", 0.003, 0.6).at(0).value, position(0.6) + 0.003, 1e-12);
  EXPECT_NEAR(value_at("late", 0.02, 0.6).at(0).value, position(0.58), 1e-12);
  EXPECT_NEAR(value_at("late", 0.02, 0.6).at(0).stamp, 0.58, 1e-9);
  EXPECT_NEAR(value_at("lagging", 0.02, 0.6).at(0).value, position(0.58), 1e-12);
  EXPECT_NEAR(value_at("lagging", 0.02, 0.6).at(0).stamp, 0.6, 1e-9);
  for (const char* kind : {"dead", "stuck", "missing", "jump", "late", "lagging"})
    EXPECT_NEAR(value_at(kind, 0.01, 0.8).at(0).value, position(0.8), 1e-12) << kind << " is over";
}

}  // namespace
}  // namespace invar::world
