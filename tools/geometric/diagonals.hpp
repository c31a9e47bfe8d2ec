// ISO 230-6: systematic deviation and reversal over the diagonals of the working volume and of its faces.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/metrology/geometric/machine.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// The diagonals of the volume, or of the faces that lie in one plane.
struct DiagonalFigures {
  struct One {
    std::string name;  // sense of each axis, "PPP" or "NP0": positive, negative, still
    std::string line;
    double deviation = 0.0;  // E of the line, m
    double reversal = 0.0;   // B of the line, m
  };
  std::string plane;  // "XY"; empty for the volume
  int count = 0;      // that there are: 4 of a volume, 2 of a plane
  std::vector<One> diagonals;
  double deviation = 0.0;  // E_d, largest E of those read
  double reversal = 0.0;   // B_d, largest B
};

/// Lines that span nine tenths of each travel and were read at their targets in both directions, more than once.
std::vector<DiagonalFigures> diagonals_of(const std::vector<PositioningTest>& tests,
                                          const metrology::Machine& machine);

/// "body diagonals (ISO 230-6): E 12.3 um, B 4.5 um, over 2 of 4"
std::string words(const DiagonalFigures& figures);
nlohmann::json diagonals_json(const std::vector<DiagonalFigures>& all);
void write_diagonals(report::Page& page, const std::vector<DiagonalFigures>& all);

}  // namespace invar::tools
