// Force ripple identified from the current of a servo whose plant has it hidden; checked by motions that were not fitted.
#include "core/physics/ripple_identification.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "core/physics/axis_controller.hpp"
#include "core/physics/axis_feedforward.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/library.hpp"

namespace invar::physics {
namespace {

constexpr double dt = 1e-3;
constexpr double pitch = 0.0317;

Model nominal() {
  Model model;
  model.plant = Plant::axis;
  model.parameters = {{"mass", "kg", 3.2, {}, {}},
                      {"motor_constant", "N/A", 12.0, {}, {}},
                      {"viscous_damping", "N s/m", 18.0, {}, {}}};
  return model;
}

Model with(Model model, const char* name, std::array<double, most_parameters> values) {
  Term term;
  term.info = find_term(Plant::axis, name);
  term.values = values;
  model.terms.push_back(term);
  return model;
}

Model truth() {
  Model model = with(nominal(), "force_ripple", {2.4, pitch, 0.7});
  model = with(model, "force_ripple", {0.8, pitch / 2, -1.9});
  model = with(model, "coulomb_friction", {1.5, 1e-4});
  return with(model, "constant_force", {-0.6});
}

struct Servo {
  explicit Servo(const Model& plant_model) : plant{make_axis(plant_model)} { plant.rest_at(0.01); }
  /// One period towards a reference; returns the current.
  double step(double reference, double feedforward = 0.0) {
    const double reading = plant.reading() + 5e-8 * noise(random);
    const double current = controller.step(reference, reading) + feedforward;
    plant.step(current, dt);
    return current;
  }
  AxisPlant plant;
  AxisController controller{
      {.kp = 2.0e4, .ki = 3.0e5, .kd = 200.0, .velocity_filter_hz = 300.0, .limit = 10.0}};
  std::mt19937 random{11};
  std::normal_distribution<double> noise;
};

/// Runs forth and back at constant velocity between 10 and 190 mm.
RippleSamples runs(const Model& plant_model, double velocity, int passes) {
  Servo servo{plant_model};
  RippleSamples samples;
  double reference = 0.01;
  for (int run = 0; run < passes; ++run) {
    const double way = run % 2 == 0 ? velocity : -velocity;
    const auto steps = static_cast<int>(0.18 / velocity / dt);
    for (int k = 0; k < steps; ++k) {
      reference += way * dt;
      const double position = servo.plant.position();
      const double current = servo.step(reference);
      if (k < 500 || k % 10 != 0) continue;  // the start is no constant velocity
      samples.position.push_back(position);
      samples.velocity.push_back(way);
      samples.current.push_back(current);
      samples.run.push_back(run);
    }
    for (int k = 0; k < 200; ++k) servo.step(reference);
  }
  return samples;
}

double following_rms(const Model& known, double period) {
  Servo servo{truth()};
  AxisFeedforward feedforward{known};
  feedforward.reset(0.01);
  double squares = 0.0;
  int count = 0;
  for (int k = 0; k < 6000; ++k) {
    const double t = k * dt, w = 2.0 * std::numbers::pi / period;
    const double reference = 0.01 + 0.08 * (1.0 - std::cos(w * t));
    const double i =
        feedforward.current({reference, 0.08 * w * std::sin(w * t), 0.08 * w * w * std::cos(w * t)});
    if (k >= 500) {
      squares += std::pow(reference - servo.plant.position(), 2);
      ++count;
    }
    servo.step(reference, i);
  }
  return std::sqrt(squares / count);
}

TEST(RippleIdentification, FindsPitchHarmonicsFrictionAndTilt) {
  const RippleFit fit = identify_ripple(nominal(), runs(truth(), 0.02, 4));
  EXPECT_NEAR(fit.pitch, pitch, 2e-5);
  EXPECT_LT(std::abs(fit.pitch - pitch), 5.0 * fit.pitch_sigma + 1e-6);
  ASSERT_EQ(fit.harmonics.size(), 2U);
  EXPECT_EQ(fit.harmonics[0].order, 1);
  EXPECT_NEAR(fit.harmonics[0].amplitude, 2.4, 0.05);
  EXPECT_NEAR(fit.harmonics[0].phase, 0.7, 0.03);
  EXPECT_EQ(fit.harmonics[1].order, 2);
  EXPECT_NEAR(fit.harmonics[1].amplitude, 0.8, 0.03);
  EXPECT_NEAR(fit.harmonics[1].phase, -1.9, 0.06);
  EXPECT_NEAR(fit.friction, 1.5, 0.05);
  EXPECT_NEAR(fit.constant, -0.6, 0.05);
  EXPECT_LT(fit.after, 0.15 * fit.before);
}

TEST(RippleIdentification, TakesOnlyTheConstantVelocityOutOfARecording) {
  Record record;
  auto& reference = record.signals["reference"];
  auto& position = record.signals["position"];
  auto& current = record.signals["current"];
  const auto add = [&](double seconds, const std::function<double(double)>& velocity) {
    for (int k = 0; k < static_cast<int>(seconds / dt); ++k) {
      const double v = velocity(k * dt);
      reference.push_back((reference.empty() ? 0.0 : reference.back()) + v * dt);
      position.push_back(reference.back());
      current.push_back(v);
      record.time.push_back(static_cast<double>(record.time.size()) * dt);
    }
  };
  const auto constant = [](double v) { return [v](double) { return v; }; };
  add(0.5, constant(0.0));
  add(0.2, [](double t) { return 0.1 * t; });
  add(2.0, constant(0.02));
  add(0.3, constant(0.05));  // too short
  add(1.0, [](double t) { return 0.05 - 0.07 * t; });
  add(2.0, constant(-0.02));
  const RippleSamples samples = constant_velocity_runs(record);
  ASSERT_NEAR(static_cast<double>(samples.size()), 2 * 1580.0, 60.0);  // 0.1 s at both ends, 0.25 s to settle
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_NEAR(samples.velocity[i], samples.run[i] == 0 ? 0.02 : -0.02, 2e-4);
    EXPECT_EQ(samples.current[i], samples.run[i] == 0 ? 0.02 : -0.02);
  }
  EXPECT_EQ(samples.run.back(), 1);
}

TEST(RippleIdentification, ClaimsNoneWhereThereIsNone) {
  const Model plain = with(nominal(), "coulomb_friction", {1.5, 1e-4});
  const RippleFit fit = identify_ripple(nominal(), runs(plain, 0.02, 4));
  double largest = 0.0;
  for (const auto& harmonic : fit.harmonics) largest = std::max(largest, harmonic.amplitude);
  EXPECT_LT(largest, 0.02);
}

TEST(RippleIdentification, FindsEveryFamilyThatStandsOut) {
  // A screw of 5 mm and a rack of 7.7 mm beside the magnets: none is a harmonic of another.
  Model three = with(truth(), "force_ripple", {0.5, 5.0e-3, 0.3});
  three = with(three, "force_ripple", {0.2, 7.7e-3, -1.0});
  const RippleFit fit = identify_ripple(nominal(), runs(three, 0.02, 4));
  ASSERT_EQ(fit.families.size(), 3U);
  EXPECT_NEAR(fit.families[0].pitch, pitch, 2e-5);
  EXPECT_NEAR(fit.families[1].pitch, 5.0e-3, 2e-6);
  EXPECT_NEAR(fit.families[1].harmonics.front().amplitude, 0.5, 0.03);
  EXPECT_NEAR(fit.families[2].pitch, 7.7e-3, 5.0 * fit.families[2].pitch_sigma);
  EXPECT_LT(fit.families[2].pitch_sigma, 5e-6);
  EXPECT_NEAR(fit.families[2].harmonics.front().amplitude, 0.2, 0.03);
  EXPECT_EQ(ripple_terms(fit).size(), 4U);
  EXPECT_EQ(identify_ripple(nominal(), runs(truth(), 0.02, 4)).families.size(), 1U);
}

/// Two slow turns forth and back of a rotary axis with cogging of 24 poles and a gear of 67 teeth.
RippleSamples turns(unsigned seed, double noise) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  RippleSamples samples;
  for (int run = 0; run < 4; ++run)
    for (int k = 0; k < 1200; ++k) {
      const double way = run % 2 == 0 ? 1.0 : -1.0;
      const double share = static_cast<double>(run % 2 == 0 ? k : 1200 - k) / 1200.0;
      const double at = 4.0 * std::numbers::pi * share;
      const double ripple = 0.05 * std::sin(24.0 * at + 0.4) + 0.02 * std::sin(67.0 * at - 1.1);
      samples.position.push_back(at);
      samples.velocity.push_back(0.5 * way);
      samples.current.push_back((0.02 * 0.5 * way + 0.1 * way - ripple + noise * normal(random)) / 0.3);
      samples.run.push_back(run);
    }
  return samples;
}

TEST(RippleIdentification, CountsARotaryAxisInAngles) {
  Model rotary;
  rotary.plant = Plant::axis;
  rotary.parameters = {{"mass", "kg m2", 2e-3, {}, {}},
                       {"motor_constant", "N m/A", 0.3, {}, {}},
                       {"viscous_damping", "N m s/rad", 0.02, {}, {}}};
  rotary.signals = {{"position", "position", "rad"}};
  ASSERT_TRUE(is_rotary(rotary));
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const RippleFit fit = identify_ripple(rotary, turns(seed, 0.01));
    ASSERT_EQ(fit.families.size(), 2U) << seed;
    EXPECT_NEAR(fit.families[0].pitch, 2.0 * std::numbers::pi / 24.0, 2e-4) << seed;
    EXPECT_NEAR(fit.families[0].harmonics.front().amplitude, 0.05, 0.003) << seed;
    EXPECT_NEAR(fit.families[0].harmonics.front().phase, 0.4, 0.05) << seed;
    EXPECT_NEAR(fit.families[1].pitch, 2.0 * std::numbers::pi / 67.0, 1e-4) << seed;
    EXPECT_NEAR(fit.families[1].harmonics.front().amplitude, 0.02, 0.003) << seed;
  }
}

TEST(RippleIdentification, FedForwardItLowersTheFollowingErrorOfAnotherMotion) {
  Model found = nominal();
  found.terms = ripple_terms(identify_ripple(nominal(), runs(truth(), 0.02, 4)));
  Model rest = nominal();  // friction and tilt known: what remains is ripple
  rest = with(with(rest, "coulomb_friction", {1.5, 1e-4}), "constant_force", {-0.6});
  Model all = rest;
  all.terms.insert(all.terms.end(), found.terms.begin(), found.terms.end());
  for (const double period : {3.0, 5.0}) {
    const double before = following_rms(rest, period);
    const double after = following_rms(all, period);
    EXPECT_LT(after, 0.2 * before) << period << " s: " << before << " to " << after;
    EXPECT_LT(following_rms(found, period), following_rms(nominal(), period));
  }
}

TEST(RippleIdentification, RippleAloneTellsThePositionModuloThePitch) {
  const RippleFit fit = identify_ripple(nominal(), runs(truth(), 0.02, 4));
  const RippleSamples met = runs(truth(), 0.05, 1);  // another run, at another speed
  const Model model = nominal();
  for (const std::size_t first : {std::size_t{0}, std::size_t{40}, std::size_t{90}}) {
    std::vector<double> travelled, force, shifted;
    for (std::size_t i = first; i < first + 100; ++i) {  // 50 mm, from an unknown place
      travelled.push_back(met.position[i] - met.position[first]);
      force.push_back(18.0 * met.velocity[i] + 1.5 - 12.0 * met.current[i]);
      shifted.push_back(travelled.back() + pitch);
    }
    double misfit = 0.0;
    const double at = position_from_ripple(fit, travelled, force, &misfit);
    const double apart = std::remainder(at - met.position[first], fit.pitch);
    EXPECT_LT(std::abs(apart), 0.2e-3);
    EXPECT_LT(misfit, 0.3);
    // One pitch further feels the same.
    EXPECT_LT(std::abs(std::remainder(position_from_ripple(fit, shifted, force) - at, fit.pitch)), 0.1e-3);
  }
}

}  // namespace
}  // namespace invar::physics
