// Windows: a model that integrates, or runs away, is compared from states set anew, never by one drifting run.
#pragma once

#include <optional>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Cuts the recordings of a model in the user's own equations into windows if the model forgets no disturbance. A push
/// on a state then grows to the end of the recording; an axis without controller is always so. Each window begins at
/// states of its own, parameters "<state>.start<k>", which every fit estimates beside the others. Their prior is as wide as the
/// state itself goes. A closed loop, a model that forgets and a recording too short for windows stay whole, but for rows at
/// which the states begin anew in any case (anew.hpp).
void cut_into_windows(Case& data);
/// The same where `near` lies nearer to the machine than what the user believes: does that forget?
void cut_into_windows(Case& data, const physics::Model& near);

/// The model with the numbers that fit it to short windows, whose states are known from what was measured. Where one run from
/// the first row goes another way than the machine (over the top, into another basin), no small step leads back. For a model
/// in the user's own equations that is not cut into windows; nothing for others and for short recordings.
std::optional<physics::Model> begun_in_windows(const Case& data);
struct InWindows {
  Case data;
  Fit fit;  // with every row alike
};
/// The case in those short windows, and its model fitted to them; nothing where there are none.
std::optional<InWindows> in_short_windows(const Case& data);

/// Are there longer windows in which the model stays near (`Case::Windows::are_long`)? Short ones keep a wrong model near the
/// machine, but begin anew before anything slow shows.
bool has_longer_windows(const Case& data);

/// The states at the beginning of the windows that bring the model nearest, all its other numbers as they stand.
void estimate_starts(Case& data);

/// The model with its states as its outputs.
physics::Model showing_states(const physics::Model& model);

/// "judged over 12 windows of 5 s, each from states of its own, because the model integrates", and what begins anew behind
/// gaps; empty where there is nothing of it.
std::string how_windowed(const Case& data);

}  // namespace invar::diagnosis
