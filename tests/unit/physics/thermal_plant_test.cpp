// Thermal nodes against closed forms.
#include "core/physics/thermal_plant.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/physics/library.hpp"

namespace invar::physics {
namespace {

ThermalTerm term(std::string_view name, std::array<double, most_parameters> parameters, std::size_t node = 0,
                 std::size_t other = 0) {
  return {thermal_kind(*find_term(Plant::thermal, name)), parameters, node, other, {}};
}

TEST(ThermalPlant, WarmsLikeAFirstOrderLag) {
  ThermalPlant plant{{{800.0, 8.0}}, {{0, 1.0}}, {}, {}};
  const double power = 80.0;
  for (int i = 0; i < 100; ++i) plant.step({{&power, 1}, 20.0}, 2.0);
  EXPECT_NEAR(plant.temperature(0), 20.0 + 10.0 * (1.0 - std::exp(-2.0)), 1e-6);
}

TEST(ThermalPlant, AHiddenNodeTakesItsShareOfTheHeatAndLosesNone) {
  ThermalPlant plant{{{500.0, 0.0}}, {{0, 1.0}}, {}, {term("hidden_node", {2.0, 300.0})}};
  const double heat = 100.0, none = 0.0;
  for (int i = 0; i < 80; ++i) plant.step({{&heat, 1}, 20.0}, 1.0);
  for (int i = 0; i < 4000; ++i) plant.step({{&none, 1}, 20.0}, 1.0);
  EXPECT_NEAR(plant.temperature(0), 20.0 + 8000.0 / 800.0, 1e-6);
}

TEST(ThermalPlant, WhatIsStoredBesideTakesItsShareOnTheWay) {
  // Without loss the heat given is the integral of all that stores: 500 J/K and 0 to 200 J/K from 20 to 40 degC.
  ThermalTerm melts{thermal_kind(*unmodelled(Plant::thermal, "storage")), {}, 0, 0, {}};
  melts.curve = {.over = "temperature", .knots = {20.0, 40.0}, .values = {0.0, 200.0}};
  ThermalPlant plant{{{500.0, 0.0}}, {{0, 1.0}}, {}, {melts}};
  const double power = 60.0;
  for (int i = 0; i < 100; ++i) plant.step({{&power, 1}, 20.0}, 1.0);
  const double risen = plant.temperature(0) - 20.0;
  EXPECT_NEAR(500.0 * risen + 0.5 * 10.0 * risen * risen, 6000.0, 1e-3);
}

TEST(ThermalPlant, ASensorLagsBehindARampByItsTimeConstant) {
  ThermalPlant plant{{{100.0, 0.0}}, {{0, 1.0}}, {}, {term("sensor_lag", {5.0})}};
  const double power = 10.0;  // 0.1 K/s
  for (int i = 0; i < 200; ++i) plant.step({{&power, 1}, 20.0}, 1.0);
  EXPECT_NEAR(plant.temperature(0) - plant.reading(0), 0.5, 1e-9);
}

TEST(ThermalPlant, ACouplingGivesToOneNodeWhatItTakesFromTheOther) {
  ThermalPlant plant{{{500.0, 0.0}, {1000.0, 0.0}}, {}, {}, {term("node_coupling", {3.0}, 0, 1)}};
  plant.set_temperature(0, 50.0);
  plant.set_temperature(1, 20.0);
  for (int i = 0; i < 100; ++i) plant.step({{}, 20.0}, 1.0);
  EXPECT_NEAR(500.0 * plant.temperature(0) + 1000.0 * plant.temperature(1), 45000.0, 1e-6);
  const double tau = 1.0 / (3.0 / 500.0 + 3.0 / 1000.0);
  EXPECT_NEAR(plant.temperature(0) - plant.temperature(1), 30.0 * std::exp(-100.0 / tau), 1e-6);
}

TEST(ThermalPlant, RadiationFollowsStefanAndBoltzmann) {
  const double coefficient = 5.67e-8 * 0.05;
  ThermalPlant plant{{{1e6, 0.0}}, {}, {}, {term("radiation", {coefficient})}};
  plant.set_temperature(0, 120.0);
  plant.step({{}, 20.0}, 10.0);
  const double loss = coefficient * (std::pow(393.15, 4) - std::pow(293.15, 4));
  EXPECT_NEAR((120.0 - plant.temperature(0)) * 1e6 / 10.0, loss, 1e-3);
}

TEST(ThermalPlant, SpeedCurrentClippingAndDriftActAsWritten) {
  const double power = 50.0;
  const auto heat_of = [&](std::vector<ThermalTerm> terms) {
    ThermalPlant plant{{{1e9, 0.0}}, {{0, 1.0}}, {}, std::move(terms)};
    plant.set_temperature(0, 30.0);
    plant.set_time(100.0);
    plant.step({{&power, 1}, 20.0, 0.5, 2.0}, 1.0);
    return (plant.temperature(0) - 30.0) * 1e9;
  };
  EXPECT_NEAR(heat_of({}), 50.0, 1e-3);
  EXPECT_NEAR(heat_of({term("speed_dependent_convection", {3.0})}), 50.0 - 3.0 * 0.5 * 10.0, 1e-3);
  EXPECT_NEAR(heat_of({term("motor_heating", {0.7})}), 50.0 + 0.7 * 4.0, 1e-3);
  EXPECT_NEAR(heat_of({term("heater_saturation", {35.0})}), 35.0, 1e-3);
  EXPECT_NEAR(heat_of({term("ambient_drift", {1e-3})}), 50.0, 1e-3);  // no loss, so the air does not matter
}

TEST(ThermalPlant, TheAirOfARoomSettlesAndItsRateIsTheMeanUntilThen) {
  // A small part follows the air at once.
  const double rate = 1e-3, settling = 2e-3, over = 1000.0;
  ThermalPlant plant{{{1.0, 50.0}}, {}, {}, {term("ambient_drift", {rate, settling, over})}};
  plant.set_temperature(0, 20.0);
  for (int i = 1; i <= 2000; ++i) {
    plant.step({{}, 20.0}, 1.0);
    const double air =
        20.0 + rate * over * (1.0 - std::exp(-settling * i)) / (1.0 - std::exp(-settling * over));
    EXPECT_NEAR(plant.temperature(0), air, 1e-4);
    if (i == 1000) {
      EXPECT_NEAR(plant.temperature(0), 20.0 + rate * over, 1e-4);
    }
  }
}

}  // namespace
}  // namespace invar::physics
