#include "core/metrology/geometric/error_motions.hpp"

#include <cmath>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

constexpr std::array<std::string_view, error_motion_count> iso{"EXX", "EYX", "EZX", "EAX", "EBX", "ECX",
                                                               "EXY", "EYY", "EZY", "EAY", "EBY", "ECY",
                                                               "EXZ", "EYZ", "EZZ", "EAZ", "EBZ", "ECZ"};
constexpr std::array<double, squareness_count> squareness_sign{-1.0, 1.0, -1.0};

}  // namespace

std::string_view iso_name(int motion) {
  INVAR_EXPECTS(motion >= 0 && motion < error_motion_count, motion);
  return iso[static_cast<std::size_t>(motion)];
}

std::string thesis_symbol(int motion) {
  INVAR_EXPECTS(motion >= 0 && motion < error_motion_count, motion);
  std::string name = is_rotation(motion) ? "eps_" : "delta_";
  name += axis_letters[static_cast<std::size_t>(direction_of(motion))];
  return name + "(" + axis_letters[static_cast<std::size_t>(axis_of(motion))] + ")";
}

std::optional<int> error_motion_named(std::string_view name) {
  for (std::size_t i = 0; i < iso.size(); ++i)
    if (iso[i] == name) return static_cast<int>(i);
  return std::nullopt;
}

std::string_view squareness_iso_name(int pair) {
  static constexpr std::array<std::string_view, squareness_count> names{"EC0Y", "EB0Z", "EA0Z"};
  return names.at(static_cast<std::size_t>(pair));
}

std::string_view squareness_thesis_symbol(int pair) {
  static constexpr std::array<std::string_view, squareness_count> names{"cos(a_xy)", "cos(a_xz)",
                                                                        "cos(a_yz)"};
  return names.at(static_cast<std::size_t>(pair));
}

double squareness_angle_from_cosine(int pair, double cosine) {
  return squareness_sign.at(static_cast<std::size_t>(pair)) * std::asin(cosine);
}

double squareness_cosine_from_angle(int pair, double angle) {
  return squareness_sign.at(static_cast<std::size_t>(pair)) * std::sin(angle);
}

std::optional<int> axis_named(std::string_view letter) {
  for (std::size_t i = 0; i < axis_letters.size(); ++i)
    if (letter.size() == 1 && letter[0] == axis_letters[i]) return static_cast<int>(i);
  return std::nullopt;
}

}  // namespace invar::metrology
