// Tests of positioning by ISO 230-2 (axes) and ISO 230-6 (diagonals): figures, tolerances, what pages and files say of them.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/displacement_line.hpp"
#include "core/metrology/iso230.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// A figure of the standard and what it may be at most [m or rad].
struct Tolerance {
  metrology::Iso230Figure figure = metrology::Iso230Figure::A;
  double limit = 0.0;
};
/// "A=10 um", "R_forward=4e-6", "E=8 arcsec". Throws InputError.
std::vector<Tolerance> read_tolerances(const std::vector<std::string>& texts, bool rotary);

/// Of one line along an axis or a diagonal that was read at each target more than once.
struct PositioningTest {
  std::string line;
  std::string axis;     // "X"; empty for a diagonal
  bool rotary = false;  // positions and deviations in rad
  int cycles = 0;       // readings of a target in one direction at least
  metrology::Iso230 figures;
};

/// Readings of one target by direction, in the order of the positions along `along`; nothing where no target repeats.
std::optional<PositioningTest> test_of(const metrology::DisplacementLine& line,
                                       const metrology::Iso230Conditions& conditions);
std::optional<PositioningTest> test_of(const std::string& axis,
                                       std::vector<metrology::TargetReadings> targets,
                                       const metrology::Iso230Conditions& conditions);

/// By ISO 14253-1: within the tolerance or beyond it counts as shown only where the expanded uncertainty leaves no doubt.
enum class Verdict { within, beyond, open };
Verdict verdict_of(const PositioningTest& test, const Tolerance& tolerance);

nlohmann::json positioning_json(const std::vector<PositioningTest>& tests,
                                const std::vector<Tolerance>& tolerances);
void write_positioning(report::Page& page, const std::vector<PositioningTest>& tests,
                       const std::vector<Tolerance>& tolerances);
void print_positioning(const std::vector<PositioningTest>& tests, const std::vector<Tolerance>& tolerances,
                       std::ostream& out);

}  // namespace invar::tools
