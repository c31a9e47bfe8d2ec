#include "core/physics/static_plants.hpp"

#include <array>
#include <vector>

#include "core/physics/term_lists.hpp"
#include "core/physics/terms/droplet/air_drag.hpp"
#include "core/physics/terms/droplet/camera_rotation.hpp"
#include "core/physics/terms/droplet/crosswind.hpp"
#include "core/physics/terms/droplet/lens_distortion.hpp"
#include "core/physics/terms/droplet/pressure_dependence.hpp"
#include "core/physics/terms/droplet/speed_decay.hpp"
#include "core/physics/terms/droplet/stage_velocity_carry.hpp"
#include "core/physics/terms/droplet/valve_delay.hpp"
#include "core/physics/terms/equations/constant.hpp"
#include "core/physics/terms/equations/coupling.hpp"
#include "core/physics/terms/equations/cubic.hpp"
#include "core/physics/terms/equations/dead_zone.hpp"
#include "core/physics/terms/equations/delay.hpp"
#include "core/physics/terms/equations/dry_friction.hpp"
#include "core/physics/terms/equations/hidden_state.hpp"
#include "core/physics/terms/equations/lag.hpp"
#include "core/physics/terms/equations/linear.hpp"
#include "core/physics/terms/equations/lower_limit.hpp"
#include "core/physics/terms/equations/overflow.hpp"
#include "core/physics/terms/equations/periodic.hpp"
#include "core/physics/terms/equations/quadratic.hpp"
#include "core/physics/terms/equations/upper_limit.hpp"
#include "core/physics/terms/error_map/abbe_offset.hpp"
#include "core/physics/terms/error_map/backlash.hpp"
#include "core/physics/terms/error_map/cosine_error.hpp"
#include "core/physics/terms/error_map/heating_rate_lag.hpp"
#include "core/physics/terms/error_map/periodic_error.hpp"
#include "core/physics/terms/error_map/refractive_index.hpp"
#include "core/physics/terms/error_map/sag.hpp"
#include "core/physics/terms/error_map/thermal_expansion.hpp"
#include "core/physics/terms/sensor/bias.hpp"
#include "core/physics/terms/sensor/gain_droop.hpp"
#include "core/physics/terms/sensor/hysteresis.hpp"
#include "core/physics/terms/sensor/latency.hpp"
#include "core/physics/terms/sensor/periodic_error.hpp"

namespace invar::physics {

namespace {

constexpr std::array error_map_terms{&error_map::PeriodicError::kind,    &error_map::Backlash::kind,
                                     &error_map::AbbeOffset::kind,       &error_map::Sag::kind,
                                     &error_map::ThermalExpansion::kind, &error_map::HeatingRateLag::kind,
                                     &error_map::RefractiveIndex::kind,  &error_map::CosineError::kind};
constexpr std::array droplet_terms{&droplet::StageVelocityCarry::kind, &droplet::AirDrag::kind,
                                   &droplet::Crosswind::kind,          &droplet::SpeedDecay::kind,
                                   &droplet::ValveDelay::kind,         &droplet::PressureDependence::kind,
                                   &droplet::LensDistortion::kind,     &droplet::CameraRotation::kind};
constexpr std::array sensor_terms{&sensor::Latency::kind, &sensor::Bias::kind, &sensor::GainDroop::kind,
                                  &sensor::PeriodicError::kind, &sensor::Hysteresis::kind};
constexpr std::array equations_terms{
    &equations::DryFriction::kind, &equations::Linear::kind,     &equations::Quadratic::kind,
    &equations::Cubic::kind,       &equations::Constant::kind,   &equations::Coupling::kind,
    &equations::Periodic::kind,    &equations::UpperLimit::kind, &equations::LowerLimit::kind,
    &equations::Overflow::kind,    &equations::Delay::kind,      &equations::Lag::kind,
    &equations::DeadZone::kind,    &equations::HiddenState::kind};

template <class Terms>
const auto* kind_in(const Terms& terms, const TermInfo& info) {
  using Kind = std::remove_pointer_t<typename Terms::value_type>;
  static constexpr std::remove_const_t<Kind> curve_alone{};
  for (const auto* kind : terms)
    if (kind->info == &info) return kind;
  return static_cast<const std::remove_const_t<Kind>*>(&curve_alone);
}

template <class Terms>
std::vector<const TermInfo*> infos(const Terms& terms) {
  std::vector<const TermInfo*> list;
  for (const auto* kind : terms) list.push_back(kind->info);
  return list;
}

}  // namespace

const ErrorMapTermKind* error_map_kind(const TermInfo& info) { return kind_in(error_map_terms, info); }
const DropletTermKind* droplet_kind(const TermInfo& info) { return kind_in(droplet_terms, info); }
const SensorTermKind* sensor_kind(const TermInfo& info) { return kind_in(sensor_terms, info); }
const EquationsTermKind* equations_kind(const TermInfo& info) { return kind_in(equations_terms, info); }

std::vector<const TermInfo*> static_terms_of(Plant plant) {
  switch (plant) {
    case Plant::error_map:
      return infos(error_map_terms);
    case Plant::droplet:
      return infos(droplet_terms);
    case Plant::sensor:
      return infos(sensor_terms);
    case Plant::equations:
      return infos(equations_terms);
    default:
      return {};
  }
}

}  // namespace invar::physics
