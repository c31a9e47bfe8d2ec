// Whether a sampled axis loop settles, from its gains, its rate and the carriage alone.
#pragma once

#include "core/physics/axis_controller.hpp"

namespace invar::physics {

/// The largest magnitude of the closed loop's poles: spectral radius of its transition over one period. From 1 on the loop is
/// unstable. The carriage is rigid, m x'' = k_f u - c x'. Its reading is taken and the current set at the tick and held over
/// the period: zero-order hold (Franklin, Powell and Workman, Digital Control of Dynamic Systems, section 4.3). The
/// clamp is left out. `inertia` = m / k_f [A s2/m], positive; `damping` = c / k_f [A s/m], not negative.
[[nodiscard]] double spectral_radius(const AxisControllerSettings& controller, double inertia,
                                     double damping);

}  // namespace invar::physics
