// Names of the 21 geometric errors of a three-axis machine: ISO 230-1 symbols beside those of the thesis
// method.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/index.hpp"

namespace invar::metrology {

/// Axis letters and directions are 0, 1, 2 for x, y, z throughout this room.
inline constexpr int axis_count = 3;
/// Six error motions an axis. The three squareness errors are counted apart (`squareness_count`).
inline constexpr int error_motion_count = 18;
inline constexpr int squareness_count = 3;

/// Error motion number 6*axis + direction (translations), + 3 (rotations): EXX EYX EZX EAX EBX ECX EXY ...
constexpr int translation(int direction, int axis) { return 6 * axis + direction; }
constexpr int rotation(int direction, int axis) { return 6 * axis + 3 + direction; }
constexpr int axis_of(int motion) { return motion / 6; }
constexpr int direction_of(int motion) { return motion % 3; }
constexpr bool is_rotation(int motion) { return motion % 6 >= 3; }
/// True for EXX, EYY, EZZ.
constexpr bool is_positioning(int motion) {
  return !is_rotation(motion) && direction_of(motion) == axis_of(motion);
}
constexpr bool is_straightness(int motion) {
  return !is_rotation(motion) && direction_of(motion) != axis_of(motion);
}

/// "EXX" ... "ECZ": ISO 230-1, E + direction + moving axis.
std::string_view iso_name(int motion);
/// The thesis's symbol in plain text: "delta_y(x)" for EYX, "eps_z(x)" for ECX.
std::string thesis_symbol(int motion);
std::optional<int> error_motion_named(std::string_view iso);

/// The unordered pair of axes of a squareness: 0 is xy, 1 is xz, 2 is yz.
constexpr int squareness_of(int a, int b) { return a + b - 1; }
/// "EC0Y", "EB0Z", "EA0Z". ISO gives the rotation of the second axis of the pair: positive EC0Y turns +Y
/// about +Z.
std::string_view squareness_iso_name(int pair);
/// "cos(a_xy)": the thesis's symbol, the cosine of the angle between the positive axes.
std::string_view squareness_thesis_symbol(int pair);
/// ISO's angle [rad] from the cosine of the angle between two positive axes, and back
/// (docs/explanation/geometric.md#squareness). cos a_xy = -sin EC0Y, cos a_xz = +sin EB0Z, cos a_yz = -sin EA0Z.
double squareness_angle_from_cosine(int pair, double cosine);
double squareness_cosine_from_angle(int pair, double angle);

inline constexpr std::array<char, 3> axis_letters{'x', 'y', 'z'};
/// "x" for axis 0.
inline std::string axis_letter(int axis) { return std::string(1, axis_letters[index(axis)]); }
std::optional<int> axis_named(std::string_view letter);

}  // namespace invar::metrology
