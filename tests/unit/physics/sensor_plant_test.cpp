// The stepping instrument against closed forms and against `simulate`, which draws on the same terms.
#include "core/physics/sensor_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/physics/static_plants.hpp"

namespace invar::physics {
namespace {

constexpr double dt = 1e-3;

SensorTerm term(std::string_view name, std::array<double, most_parameters> parameters) {
  return {sensor_kind(*find_term(Plant::sensor, name)), parameters};
}
double position(double t) { return 0.05 * (1.0 - std::cos(2.0 * t)); }
double velocity(double t) { return 0.1 * std::sin(2.0 * t); }

TEST(SensorPlant, ShowsThePositionOfAnEarlierTime) {
  SensorPlant sensor{SensorPlant::Quantity::position, {term("latency", {7.3e-3})}};
  for (int k = 1; k < 4000; ++k) {
    const double reading = sensor.step(position(k * dt), velocity(k * dt), dt);
    if (k <= 10) continue;
    EXPECT_NEAR(reading, position(k * dt - 7.3e-3), 1e-9);
  }
}

TEST(SensorPlant, AVelocitySensorLosesGainWithSpeedAndAddsItsBias) {
  SensorPlant sensor{SensorPlant::Quantity::velocity, {term("gain_droop", {0.2}), term("bias", {1e-3})}, 1.1};
  for (int k = 1; k < 100; ++k) {
    const double v = velocity(k * dt);
    EXPECT_NEAR(sensor.step(position(k * dt), v, dt), 1.1 * v * (1.0 - 0.2 * std::abs(v)) + 1e-3, 1e-12);
  }
}

TEST(SensorPlant, PlayComesLateByItsWidthAfterAReversal) {
  SensorPlant sensor{SensorPlant::Quantity::position, {term("hysteresis", {2e-4})}};
  double reading = 0.0;
  for (int k = 1; k <= 100; ++k) reading = sensor.step(1e-4 * k, 0.1, dt);
  EXPECT_NEAR(reading, 0.01 - 1e-4, 1e-12);
  for (int k = 99; k >= 50; --k) reading = sensor.step(1e-4 * k, -0.1, dt);
  EXPECT_NEAR(reading, 0.005 + 1e-4, 1e-12);
}

TEST(SensorPlant, ShowsWhatSimulateShows) {
  Model model;
  model.plant = Plant::sensor;
  model.signals = {
      {"true_position", "x", "m", false}, {"encoder", "e", "m", true}, {"velocity_sensor", "v", "m/s", true}};
  Record record;
  auto& truth = record.signals["true_position"];
  for (int k = 0; k < 3000; ++k) {
    record.time.push_back(k * dt);
    truth.push_back(position(k * dt));
  }
  const auto add = [&](std::string_view name, std::array<double, most_parameters> values, const char* on) {
    Term t;
    t.info = find_term(Plant::sensor, name);
    t.values = values;
    t.on = on;
    model.terms.push_back(t);
  };
  add("latency", {3e-3}, "encoder");
  add("periodic_error", {2e-5, 2e-3, 0.4}, "encoder");
  add("gain_droop", {0.1}, "velocity_sensor");
  Outputs outputs;
  prepare(model, record)->run(model, outputs);
  SensorPlant encoder{SensorPlant::Quantity::position,
                      {term("latency", {3e-3}), term("periodic_error", {2e-5, 2e-3, 0.4})}};
  SensorPlant speed{SensorPlant::Quantity::velocity, {term("gain_droop", {0.1})}};
  for (std::size_t k = 1; k + 1 < record.rows(); ++k) {
    const double t = record.time[k];
    const double e = encoder.step(position(t), velocity(t), dt);
    const double v = speed.step(position(t), velocity(t), dt);
    if (k < 10) continue;
    EXPECT_NEAR(e, outputs[0][k], 1e-9);
    EXPECT_NEAR(v, outputs[1][k], 1e-7);  // simulate differentiates the truth
  }
}

}  // namespace
}  // namespace invar::physics
