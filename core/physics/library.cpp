#include "core/physics/library.hpp"

#include <algorithm>
#include <array>

#include "core/physics/term_lists.hpp"
#include "core/physics/terms/axis/additive_disturbance.hpp"
#include "core/physics/terms/axis/amplifier_lag.hpp"
#include "core/physics/terms/axis/backlash.hpp"
#include "core/physics/terms/axis/constant_force.hpp"
#include "core/physics/terms/axis/coulomb_friction.hpp"
#include "core/physics/terms/axis/dead_zone.hpp"
#include "core/physics/terms/axis/encoder_periodic_error.hpp"
#include "core/physics/terms/axis/flexible_mode.hpp"
#include "core/physics/terms/axis/force_ripple.hpp"
#include "core/physics/terms/axis/magnetic_saturation.hpp"
#include "core/physics/terms/axis/measurement_delay.hpp"
#include "core/physics/terms/axis/motor_constant_ripple.hpp"
#include "core/physics/terms/axis/periodic_disturbance.hpp"
#include "core/physics/terms/axis/position_stiffness.hpp"
#include "core/physics/terms/axis/presliding_friction.hpp"
#include "core/physics/terms/axis/quadratic_drag.hpp"
#include "core/physics/terms/axis/slow_drift.hpp"
#include "core/physics/terms/axis/stribeck_friction.hpp"
#include "core/physics/terms/axis/transport_delay.hpp"
#include "core/physics/terms/thermal/ambient_drift.hpp"
#include "core/physics/terms/thermal/heater_saturation.hpp"
#include "core/physics/terms/thermal/hidden_node.hpp"
#include "core/physics/terms/thermal/motor_heating.hpp"
#include "core/physics/terms/thermal/node_coupling.hpp"
#include "core/physics/terms/thermal/radiation.hpp"
#include "core/physics/terms/thermal/sensor_lag.hpp"
#include "core/physics/terms/thermal/speed_dependent_convection.hpp"

namespace invar::physics {

namespace {

constexpr std::string_view no_name =
    "An effect that no term of the library describes, as a curve over the variable on which it depends.";

constexpr TermInfo unnamed(Plant plant, std::string_view site) {
  return {.name = "unmodelled",
          .plant = plant,
          .site = site,
          .description = no_name,
          .source = "fitted to the recording",
          .is_curve = true};
}

constexpr std::array unmodelled_infos{
    unnamed(Plant::axis, "force"),
    unnamed(Plant::axis, "actuator"),
    unnamed(Plant::thermal, "loss"),
    unnamed(Plant::thermal, "source"),
    unnamed(Plant::error_map, "kinematic"),
    unnamed(Plant::error_map, "thermal"),
    unnamed(Plant::error_map, "measurement"),
    unnamed(Plant::droplet, "flight"),
    unnamed(Plant::droplet, "valve"),
    unnamed(Plant::droplet, "camera"),
    unnamed(Plant::sensor, "measurement"),
    unnamed(Plant::equations, "state"),
    unnamed(Plant::equations, "output"),
};

constexpr TermInfo thermal_unmodelled_storage_info = unnamed(Plant::thermal, "storage");
constexpr ThermalTermKind thermal_unmodelled_storage{.info = &thermal_unmodelled_storage_info};
constexpr TermInfo thermal_unmodelled_exchange_info = unnamed(Plant::thermal, "exchange");
constexpr ThermalTermKind thermal_unmodelled_exchange{.info = &thermal_unmodelled_exchange_info};
constexpr TermInfo axis_unmodelled_reading_info = unnamed(Plant::axis, "measurement");
constexpr AxisTermKind axis_unmodelled_reading{.info = &axis_unmodelled_reading_info};
constexpr AxisTermKind axis_unmodelled_force{.info = &unmodelled_infos[0]};
constexpr AxisTermKind axis_unmodelled_motor{.info = &unmodelled_infos[1]};
constexpr ThermalTermKind thermal_unmodelled_loss{.info = &unmodelled_infos[2]};
constexpr ThermalTermKind thermal_unmodelled_source{.info = &unmodelled_infos[3]};

constexpr std::array axis_terms{
    &CoulombFriction::kind,     &StribeckFriction::kind,     &PreslidingFriction::kind,
    &ForceRipple::kind,         &PositionStiffness::kind,    &ConstantForce::kind,
    &QuadraticDrag::kind,       &MotorConstantRipple::kind,  &MagneticSaturation::kind,
    &TransportDelay::kind,      &AmplifierLag::kind,         &DeadZone::kind,
    &AdditiveDisturbance::kind, &EncoderPeriodicError::kind, &Backlash::kind,
    &MeasurementDelay::kind,    &FlexibleMode::kind,         &PeriodicDisturbance::kind,
    &SlowDrift::kind,
};

constexpr std::array thermal_terms{
    &Radiation::kind,        &SpeedDependentConvection::kind,
    &HiddenNode::kind,       &SensorLag::kind,
    &NodeCoupling::kind,     &MotorHeating::kind,
    &HeaterSaturation::kind, &AmbientDrift::kind,
};

constexpr std::array<std::string_view, 6> plant_names{"axis",    "thermal", "error_map",
                                                      "droplet", "sensor",  "equations"};

}  // namespace

std::string_view name_of(Plant plant) { return plant_names[static_cast<std::size_t>(plant)]; }

bool plant_by_name(std::string_view name, Plant& plant) {
  const auto at = std::find(plant_names.begin(), plant_names.end(), name);
  if (at == plant_names.end()) return false;
  plant = static_cast<Plant>(at - plant_names.begin());
  return true;
}

std::vector<const TermInfo*> terms_of(Plant plant) {
  auto terms = static_terms_of(plant);
  if (plant == Plant::axis)
    for (const auto* kind : axis_terms) terms.push_back(kind->info);
  if (plant == Plant::thermal)
    for (const auto* kind : thermal_terms) terms.push_back(kind->info);
  return terms;
}

const TermInfo* find_term(Plant plant, std::string_view name) {
  for (const auto* info : terms_of(plant))
    if (info->name == name) return info;
  return nullptr;
}

const TermInfo* unmodelled(Plant plant, std::string_view site) {
  for (const auto* info :
       {&axis_unmodelled_reading_info, &thermal_unmodelled_storage_info, &thermal_unmodelled_exchange_info})
    if (plant == info->plant && site == info->site) return info;
  const TermInfo* any = nullptr;
  for (const auto& info : unmodelled_infos) {
    if (info.plant != plant) continue;
    if (info.site == site) return &info;
    if (any == nullptr) any = &info;
  }
  return any;
}

std::vector<std::string_view> multipliers_of(const TermInfo& unmodelled) {
  if (unmodelled.plant == Plant::axis && unmodelled.site == "force")
    return {"direction", "velocity", "acceleration"};
  if (unmodelled.plant == Plant::axis && unmodelled.site == "actuator") return {"command"};
  if (unmodelled.plant == Plant::thermal && unmodelled.site == "source") return {"power"};
  if (unmodelled.plant == Plant::error_map) return {"direction", "position", "temperature"};
  if (unmodelled.plant == Plant::droplet) return {"height"};
  if (unmodelled.plant == Plant::sensor) return {"true_position", "velocity"};
  return {};
}

const AxisTermKind* axis_kind(const TermInfo& info) {
  if (&info == axis_unmodelled_force.info) return &axis_unmodelled_force;
  if (&info == axis_unmodelled_reading.info) return &axis_unmodelled_reading;
  if (&info == axis_unmodelled_motor.info) return &axis_unmodelled_motor;
  for (const auto* kind : axis_terms)
    if (kind->info == &info) return kind;
  return nullptr;
}

const ThermalTermKind* thermal_kind(const TermInfo& info) {
  if (&info == thermal_unmodelled_loss.info) return &thermal_unmodelled_loss;
  if (&info == thermal_unmodelled_storage.info) return &thermal_unmodelled_storage;
  if (&info == thermal_unmodelled_exchange.info) return &thermal_unmodelled_exchange;
  if (&info == thermal_unmodelled_source.info) return &thermal_unmodelled_source;
  for (const auto* kind : thermal_terms)
    if (kind->info == &info) return kind;
  return nullptr;
}

}  // namespace invar::physics
