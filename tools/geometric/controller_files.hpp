// Geometric models in the forms that machine controllers read; each can be read back and compared.
#pragma once

#include <array>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_model.hpp"
#include "core/metrology/geometric/rotary_axis.hpp"

namespace invar::tools {

/// ISG kernel and TwinCAT CNC (TF5280), file_format ISG_CSV: one record a node of a grid over the travels, `X Y Z EXX EYY
/// EZZ` in mm, the error at the calibration's tool (actual minus commanded). `count` nodes an axis. `unidentified`: ISO names
/// that the lines left open; an error along an axis of which no line told the positioning has no column. The format knows no
/// direction: `moving` +1 or -1 writes the grid of all axes moving forward or backward, 0 the mean of both.
std::string isg_volumetric_csv(const metrology::GeometricModel& model, int count,
                               const std::set<std::string>& unidentified = {}, int moving = 0);

/// Whether the lines told the positioning of an axis: EXX of x.
bool positioning_is_known(const metrology::GeometricModel& model, int axis,
                          const std::set<std::string>& unidentified);

/// LinuxCNC [JOINT_n]COMP_FILE with COMP_FILE_TYPE = 0: nominal, actual forward, actual backward in mm, at most 256 points,
/// along `axis` with the others at the origin of the travels.
std::string linuxcnc_compensation(const metrology::GeometricModel& model, int axis);

/// The same of a rotary axis, in degrees.
std::string linuxcnc_compensation(const metrology::RotaryAxis& axis);
/// In rad.
double linuxcnc_difference(const metrology::RotaryAxis& axis);

/// How far that table, straight between its points, may be from the model [m]: a screw's wave bends between them.
double linuxcnc_difference(const metrology::GeometricModel& model, int axis);

/// Squareness as plain numbers: angle between the axes, its standard deviation, and mm per m. A pair that no line told is a
/// comment, not a zero.
std::string skew_numbers(const metrology::GeometricModel& model,
                         const std::set<std::string>& unidentified = {});

/// The field that an ISG table says at a position [m], trilinear; for checking what was written. Throws InputError.
class IsgTable {
 public:
  explicit IsgTable(const std::string& text);
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position) const;

 private:
  std::array<std::vector<double>, 3> nodes_;  // m
  std::vector<Eigen::Vector3d> values_;       // m, x fastest
};

/// Actual minus nominal position [m] along the axis that a LinuxCNC file says, moving forward (+1) or backward (-1).
double linuxcnc_error(const std::string& text, double nominal, int direction);

}  // namespace invar::tools
