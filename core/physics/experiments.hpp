// Experiments that tell several pairs of terms apart: each is named in the files of the terms (`told_apart`).
#pragma once

namespace invar::physics::experiments {

inline constexpr const char* both_ways =
    "move in both directions: friction turns its sign with the motion, a constant force does not";
inline constexpr const char* creep =
    "move to and fro by some micrometres, and then by millimetres: before it slides a bristle springs, which "
    "shows in the small motion alone";
inline constexpr const char* quick =
    "excite the axis up to some hundred hertz: a delay keeps the amplitude, a lag takes it down";

}  // namespace invar::physics::experiments
