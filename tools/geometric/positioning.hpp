// Tests of positioning by ISO 230-2 (axes) and ISO 230-6 (diagonals): figures, tolerances, what pages and files say of them.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/error_motion_identification.hpp"
#include "core/metrology/geometric/iso230.hpp"
#include "tools/geometric/tolerance.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// Readings at targets in one or both directions, each target more than once: an axis, a diagonal, an error motion.
struct PositioningTest {
  std::string line;
  std::string axis;                                // "X"; empty for a diagonal
  std::string motion;                              // "EXX" where an error motion was measured itself
  std::string place_unit = "m";                    // of the targets, or "rad"
  std::string unit = "m";                          // of the deviations, or "rad"
  Eigen::Vector3d span = Eigen::Vector3d::Zero();  // m, of the line, from its start
  int cycles = 0;                                  // readings of a target in one direction at least
  metrology::Iso230 figures;
};

/// Readings of one target by direction, in the order of the positions along `along`; nothing where no target repeats.
std::optional<PositioningTest> test_of(const metrology::DisplacementLine& line,
                                       const metrology::Iso230Conditions& conditions);
std::optional<PositioningTest> test_of(const std::string& axis,
                                       std::vector<metrology::TargetReadings> targets,
                                       const metrology::Iso230Conditions& conditions);
/// Readings by target, ascending; those nearer than 0.1 um or 0.1 urad are of one target.
std::vector<metrology::TargetReadings> targets_of(const metrology::ErrorMotionReadings& readings);

Verdict verdict_of(const PositioningTest& test, const Tolerance& tolerance);
/// Those that mean this test.
std::vector<Tolerance> tolerances_of(const PositioningTest& test, const std::vector<Tolerance>& all);

nlohmann::json positioning_json(const std::vector<PositioningTest>& tests,
                                const std::vector<Tolerance>& tolerances);
void write_positioning(report::Page& page, const std::vector<PositioningTest>& tests,
                       const std::vector<Tolerance>& tolerances);
void print_positioning(const std::vector<PositioningTest>& tests, const std::vector<Tolerance>& tolerances,
                       std::ostream& out);

}  // namespace invar::tools
