// A diagnosed head (model.yaml of plant droplet) as the trajectory by which a dispenser aims.
#pragma once

#include <string_view>

#include "core/metrology/droplet/droplet_trajectory.hpp"
#include "core/physics/model.hpp"

namespace invar::compensation {

/// Why a dispenser cannot aim by a term; empty: it can, or the term moves no droplet, as a camera's.
std::string_view why_not_aimed_by(const physics::Term& term);

/// Placement and slope with what is believed of them, delay and carry of the terms; terms with a `why_not_aimed_by` are left
/// out. The model says nothing of heights: the dispenser judges each by its sigma. Precondition: plant droplet.
metrology::DropletTrajectory trajectory_of(const physics::Model& model);

}  // namespace invar::compensation
