// The terms of error maps, droplets, sensors and equations by their info.
#pragma once

#include "core/physics/droplet_hooks.hpp"
#include "core/physics/equations_hooks.hpp"
#include "core/physics/error_map_hooks.hpp"
#include "core/physics/sensor_hooks.hpp"

namespace invar::physics {

/// Never null for a term of the plant; an `unmodelled` term has a kind that does nothing but through its curve.
const ErrorMapTermKind* error_map_kind(const TermInfo& info);
const DropletTermKind* droplet_kind(const TermInfo& info);
const SensorTermKind* sensor_kind(const TermInfo& info);
const EquationsTermKind* equations_kind(const TermInfo& info);

}  // namespace invar::physics
