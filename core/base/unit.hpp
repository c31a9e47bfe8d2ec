// Units: the one table by which numbers are converted at the edge (YAML, CSV, command line, register map,
// report).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace invar {

/// Quantity of a unit and its map to SI: si = factor * value + offset. Temperatures count in degC ("K"
/// as a unit of its own means kelvin above absolute zero; inside a product it is a difference, as in W/K).
struct Unit {
  /// Exponents of m, kg, s, A, K, rad, px, count; real numbers, since V^0.5/s is a unit of a tank's outflow.
  std::array<double, 8> dimension{};
  double factor = 1.0;
  double offset = 0.0;

  [[nodiscard]] bool same_quantity(const Unit& other) const;
};

/// Reads "N s/m", "W/(K m)", "1/px2", "V^0.5/s", "um", "arcsec", "degC", "W/W", "1". A space or '*'
/// multiplies,
/// '/' divides what follows it alone, a digit or ^number behind a name is its power. Nothing when it is no
/// unit.
std::optional<Unit> parse_unit(std::string_view text);

/// The SI unit of this quantity, as parse_unit reads it: "m3/s", "N", "1/s"; of a temperature "degC", of a pure number "".
std::string si_unit(const Unit& unit);

/// The factor and offset that carry a value in `from` to `to`; nothing when one is no unit or they measure
/// different things. Angles and pure numbers (rad, 1) are compatible; rpm and Hz are turns beside rad/s; C and F are degrees
/// beside a temperature.
struct Conversion {
  double factor = 1.0;
  double offset = 0.0;
  [[nodiscard]] double operator()(double value) const { return factor * value + offset; }
};
std::optional<Conversion> conversion(std::string_view from, std::string_view to);

}  // namespace invar
