// Friction, play or a dead zone so small that the noise of the loop shakes the machine across it all the time. A run without
// noise sticks where the machine does not, and shows nothing of the effect.
#pragma once

#include <optional>
#include <set>
#include <string>

#include "core/diagnosis/evidence/loop_noise.hpp"

namespace invar::diagnosis {

struct ShakenLoose {
  physics::Model model;    // with the bend as its last term
  Weighing weighing;       // by what it leaves
  physics::Model without;  // the base under this weighing
  double gain = 0.0;       // log likelihood over that, both shaken by the noise, less the price of its size
};

/// The bend, of those that `without` leaves, whose runs under the noise come nearest to what was recorded at some size, the
/// numbers of `base` free beside it. None where no loop feeds noise back, or where none is sure.
std::optional<ShakenLoose> shaken_loose(const Case& data, const LoopNoise& noise, const Weighing& weighing,
                                        const Fit& base, const std::set<std::string, std::less<>>& without);

}  // namespace invar::diagnosis
