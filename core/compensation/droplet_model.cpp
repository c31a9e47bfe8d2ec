#include "core/compensation/droplet_model.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::compensation {

namespace {

/// Variance [SI] of a parameter; where nothing is known of it, so much that nobody prints by it.
double variance(const physics::Model& model, std::string_view name) {
  const auto* parameter = model.find(name);
  if (parameter == nullptr) return 0.0;
  return parameter->sigma ? *parameter->sigma * *parameter->sigma : 1.0;
}

}  // namespace

std::string_view why_not_aimed_by(const physics::Term& term) {
  if (term.info->site == "camera") return {};
  if (term.info->name == "stage_velocity_carry" || term.info->name == "valve_delay") return {};
  if (term.info->name == "pressure_dependence")
    return "the aim is for one pressure; calibrate the head at the pressure in use";
  if (term.info->name == "speed_decay") return "it goes over time; let the job that prints follow the head";
  return "its shift is not straight in the height";
}

metrology::DropletTrajectory trajectory_of(const physics::Model& model) {
  INVAR_EXPECTS(model.plant == physics::Plant::droplet);
  metrology::DropletTrajectory path;
  path.placement << model.value("placement_error_x"), model.value("placement_error_y");
  path.slope << model.value("slope_x"), model.value("slope_y");
  path.covariance.setZero();
  path.covariance(0, 0) =
      std::max(variance(model, "placement_error_x"), variance(model, "placement_error_y"));
  path.covariance(1, 1) = std::max(variance(model, "slope_x"), variance(model, "slope_y"));
  for (const auto& term : model.terms) {
    if (term.info->name == "stage_velocity_carry" && term.values[0] > 0.0) {
      path.slowness = 1.0 / term.values[0];
      if (term.sigmas[0]) path.slowness_sigma = *term.sigmas[0] * path.slowness * path.slowness;
    }
    if (term.info->name == "valve_delay") {
      path.delay += term.values[0];
      if (term.sigmas[0]) path.delay_sigma = *term.sigmas[0];
    }
  }
  return path;
}

}  // namespace invar::compensation
