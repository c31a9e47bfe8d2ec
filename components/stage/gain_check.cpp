// Whether the gains of a stage would make its axis unstable, as far as the inertia is known.
#include <array>
#include <cstdio>

#include "components/stage/axis_stage.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/axis_stability.hpp"

namespace invar::stage {

physics::AxisControllerSettings Stage::controller_settings(double period) const {
  const Control& control = parameters_.control;
  using Kind = physics::AxisControllerSettings::Kind;
  physics::AxisControllerSettings result;
  result.kind = control.kind == "cascade" ? Kind::cascade : Kind::pid;
  result.rate = 1.0 / period;
  result.kp = control.kp;
  result.ki = control.ki;
  result.kd = control.kd;
  result.kv = control.kv;
  result.velocity_filter_hz = control.velocity_filter;
  result.limit = control.limit;
  return result;
}

/// Inertia and damping over motor constant, as fed forward or as the model says.
std::optional<Stage::Inertia> Stage::inertia() const {
  const Control& control = parameters_.control;
  if (control.feedforward_acceleration > 0.0)
    return Inertia{control.feedforward_acceleration, control.feedforward_velocity};
  if (parameters_.model.empty()) return {};
  try {
    const auto model = model::load(parameters_.model);
    const double force = model.plant == physics::Plant::axis ? model.value("motor_constant") : 0.0;
    const double mass = force > 0.0 ? model.value("mass") : 0.0;
    if (mass > 0.0) return Inertia{mass / force, std::max(0.0, model.value("viscous_damping")) / force};
  } catch (const InputError&) {  // said where the model is loaded
  }
  return {};
}

std::optional<Component::Unfit> Stage::unfit(double period) const {
  const auto known = inertia();
  if (!known) return {};
  const double radius = physics::spectral_radius(controller_settings(period), known->mass, known->damping);
  if (radius < 1.0) return {};
  std::array<char, 160> why{};
  std::snprintf(why.data(), why.size(),
                "with these gains the loop is unstable at %.6g Hz (it grows by %.3g times a period)",
                1.0 / period, radius);
  return Unfit{why.data(), "control", "step it more often, or lower kp, ki and kd (in a cascade kp and kv)"};
}

}  // namespace invar::stage
