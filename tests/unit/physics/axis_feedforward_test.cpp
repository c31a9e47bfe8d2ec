// The current a motion needs: against closed forms, and by driving the plant with it.
#include "core/physics/axis_feedforward.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "core/physics/library.hpp"

namespace invar::physics {
namespace {

Model axis(const std::vector<std::pair<const char*, std::vector<double>>>& terms) {
  Model model;
  model.plant = Plant::axis;
  model.parameters = {{"mass", "kg", 4.0, {}, {}},
                      {"motor_constant", "N/A", 20.0, {}, {}},
                      {"viscous_damping", "N s/m", 12.0, {}, {}}};
  for (const auto& [name, values] : terms) {
    Term term;
    term.info = find_term(Plant::axis, name);
    for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
      term.values[i] = term.info->parameters[i].starts[0];
    std::copy(values.begin(), values.end(), term.values.begin());
    model.terms.push_back(term);
  }
  return model;
}

TEST(AxisFeedforward, IsTheForceBalanceOverTheMotorConstant) {
  AxisFeedforward plain{axis({})};
  EXPECT_NEAR(plain.current({0.1, 0.5, 2.0}), (4.0 * 2.0 + 12.0 * 0.5) / 20.0, 1e-12);
  AxisFeedforward held{axis({{"position_stiffness", {800.0, 0.05}}, {"coulomb_friction", {7.0}}})};
  const double friction =
      AxisPlant{{}, {{axis_kind(*find_term(Plant::axis, "coulomb_friction")), {7.0}, {}}}}.force(
          {.velocity = -0.5}, -1.0);
  EXPECT_NEAR(friction, 7.0 + 0.0, 0.1);  // against a motion downwards it pushes up
  EXPECT_NEAR(held.current({0.1, -0.5, 0.0}), (-12.0 * 0.5 + 800.0 * 0.05 - 7.0) / 20.0, 0.01);
}

TEST(AxisFeedforward, UndoesSaturationAndDeadZoneOfTheMotor) {
  AxisFeedforward weak{axis({{"magnetic_saturation", {0.01}}})};
  const double i = weak.current({0.0, 0.0, 15.0});
  EXPECT_NEAR(20.0 * i * (1.0 - 0.01 * i * i), 4.0 * 15.0, 0.05);
  AxisFeedforward dead{axis({{"dead_zone", {0.2}}})};
  EXPECT_NEAR(dead.current({0.0, 0.0, -1.0}), -0.2 - 0.2, 1e-12);
  EXPECT_EQ(dead.current({0.0, 0.0, 0.0}), 0.0);
}

TEST(AxisFeedforward, LeavesOutWhatItsClockDoesNotKnowAndLooksAheadByDelays) {
  AxisFeedforward timed{axis({{"periodic_disturbance", {30.0, 7.0}},
                              {"slow_drift", {5.0}},
                              {"transport_delay", {0.003}},
                              {"amplifier_lag", {0.002}}})};
  EXPECT_EQ(timed.current({0.1, 0.0, 0.0}), 0.0);
  EXPECT_NEAR(timed.lead(), 0.005, 1e-15);
}

TEST(AxisFeedforward, TakesTheEncodersErrorOutOfItsReading) {
  const auto model = axis({{"encoder_periodic_error", {2e-6, 1e-3, 0.7}}});
  const AxisFeedforward known{model};
  auto plant = make_axis(model);
  for (double x = 0.0; x < 2e-3; x += 3.7e-5) {
    plant.rest_at(x);
    EXPECT_NEAR(plant.reading() - known.reading_error(plant.reading()), x, 1e-9) << x;
  }
}

/// The plant driven open loop by the current alone, along 60 mm and back: how far off it ends at the worst.
double worst_error(const Model& truth, const Model& believed) {
  auto plant = make_axis(truth);
  AxisFeedforward forward{believed};
  constexpr double h = 2.5e-4, swing = 0.03, omega = 2.0 * std::numbers::pi;
  plant.rest_at(0.02);
  forward.reset(0.02);
  double worst = 0.0;
  for (int k = 0; k < 4000; ++k) {
    const double t = (k + 0.5) * h;  // the middle of the step that the current is held for
    const double current =
        forward.current({0.02 + swing * (1.0 - std::cos(omega * t)), swing * omega * std::sin(omega * t),
                         swing * omega * omega * std::cos(omega * t)});
    plant.step(current, h);
    worst =
        std::max(worst, std::abs(plant.position() - 0.02 - swing * (1.0 - std::cos(omega * (k + 1) * h))));
  }
  return worst;
}

TEST(AxisFeedforward, DrivesThePlantAlongTheMotion) {
  const auto truth = axis({{"force_ripple", {6.0, 0.02, 1.0}},
                           {"position_stiffness", {300.0, 0.05}},
                           {"quadratic_drag", {9.0}},
                           {"motor_constant_ripple", {0.05, 0.03, 0.3}}});
  const double with = worst_error(truth, truth), without = worst_error(truth, axis({}));
  EXPECT_LT(with, 2e-5);
  EXPECT_GT(without, 100.0 * with);
}

TEST(AxisFeedforward, BendsTheBristlesOfPreslidingFriction) {
  const auto truth = axis({{"presliding_friction", {8.0, 1e5, 0.0}}});
  EXPECT_LT(worst_error(truth, truth), 0.02 * worst_error(truth, axis({})));
}

}  // namespace
}  // namespace invar::physics
