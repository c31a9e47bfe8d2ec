// The part of a long recording that is looked at: physics of an hour shows in minutes of it, at a cost that does not grow.
#pragma once

#include <string>
#include <vector>

#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Rows of one recording that a fit runs through; beyond, a recording is shortened.
inline constexpr std::size_t most_rows = 30000;

struct Stretch {
  physics::Record record;
  std::size_t forget =
      0;  // leading rows in which the machine's state is not that of the start: not to be compared
};

/// A loop is simulated tick by tick, also where nothing was recorded. Its recording is split where more is missing than a
/// simulation should bridge, a recording of heat where a heater was switched in a gap. Parts too short to say anything are left
/// out. Other plants: the recording itself.
std::vector<Stretch> without_pauses(const physics::Model& model, physics::Record record);

/// The recording itself where it has at most `most` rows. A longer one is shortened by plant. Axis and sensor: stretches spread
/// over the recording, an axis from where it stands. Heat: means over equal spans. Maps and drops: one point in so many. The
/// user's equations: their beginning. Rows in order of time.
std::vector<Stretch> shortened(const physics::Model& model, physics::Record record, std::size_t most);

/// The part of a recording of this plant that is then looked at, in words: "its beginning is".
std::string how_shortened(const physics::Model& model);

}  // namespace invar::diagnosis
