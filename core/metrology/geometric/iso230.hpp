// ISO 230-2: accuracy and repeatability of positioning of one axis, linear or rotary, from readings in both directions.
#pragma once

#include <array>
#include <string_view>
#include <vector>

namespace invar::metrology {

/// Readings at one target: position reached less target [m or rad], by direction, cycle by cycle.
struct TargetReadings {
  double position = 0.0;  // m or rad
  std::vector<double> forward;
  std::vector<double> backward;
};

/// Figures of one target (ISO 230-2:2014, 3.9 to 3.18). NaN where a direction was not read, or fewer than twice.
struct TargetFigures {
  double position = 0.0;
  double mean_forward = 0.0, mean_backward = 0.0;
  double mean = 0.0;      // bidirectional
  double reversal = 0.0;  // B_i, forward less backward
  double s_forward = 0.0, s_backward = 0.0;
  double repeatability_forward = 0.0, repeatability_backward = 0.0;  // R_i, 4 s_i
  double repeatability = 0.0;                                        // R_i, bidirectional
};

/// Figures of the axis, in the order of `iso230_names`. NaN where the readings do not give one.
enum class Iso230Figure {
  B,
  B_mean,
  R_forward,
  R_backward,
  R,
  E_forward,
  E_backward,
  E,
  M,
  A_forward,
  A_backward,
  A
};
inline constexpr std::size_t iso230_figures = 12;
inline constexpr std::array<std::string_view, iso230_figures> iso230_names{
    "B",          "B_mean", "R_forward", "R_backward", "R",          "E_forward",
    "E_backward", "E",      "M",         "A_forward",  "A_backward", "A"};

struct Iso230 {
  std::vector<TargetFigures> targets;
  std::array<double, iso230_figures> values{};
  /// Expanded (k = 2): of the chance in these few readings, and of the instrument and the surroundings, together.
  std::array<double, iso230_figures> uncertainty{};
  [[nodiscard]] double operator[](Iso230Figure figure) const {
    return values[static_cast<std::size_t>(figure)];
  }
};

/// Standard uncertainties that the readings share, beside their chance.
struct Iso230Conditions {
  double device =
      0.0;  // of 1: the instrument's scale, its alignment and the temperature of the axis, by the length
  double environment = 0.0;  // m or rad: what the surroundings move a reading by while a test lasts
};

/// All readings count: the standard knows no outliers. The chance of each figure is that of readings drawn again about the
/// means with the s_i found (seeded, so the same each time). Set-up only.
Iso230 iso230(const std::vector<TargetReadings>& readings, const Iso230Conditions& conditions = {});

}  // namespace invar::metrology
