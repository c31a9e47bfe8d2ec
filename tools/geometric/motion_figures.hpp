// Figures of ISO 230-1: straightness, angular error and squareness of linear axes, measured themselves or identified.
#pragma once

#include <array>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/geometric/error_motion_identification.hpp"
#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/identifiability.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct MotionFigure {
  struct Value {
    std::string reference;  // straight line that deviations count from; empty where there is none
    double value = 0.0;
    double uncertainty = 0.0;  // expanded, k = 2
  };
  std::string motion;         // "EYX", "EC0Y"
  std::string figure;         // "straightness", "angular error", "squareness"
  std::string unit;           // "m" or "rad"
  Range range;                // m, of the axis' positions; empty for a squareness
  std::vector<Value> values;  // a tolerance means the first
};

/// From the means of the readings at each place, those used. A motion that depends on a state of the machine has none.
/// `environment` [m]: standard uncertainty of what the surroundings move a reading of a length by.
using MotionReadings =
    std::array<std::optional<metrology::ErrorMotionReadings>, metrology::error_motion_count>;
using MotionFits = std::array<std::optional<metrology::ErrorMotionFit>, metrology::error_motion_count>;
std::vector<MotionFigure> motion_figures(const MotionReadings& readings, const MotionFits& fits,
                                         const metrology::ErrorMotionNetworks& model, double environment);

/// From the curves that the lines identified: a motion that they leave open by a fifth of its variance has no figure.
std::vector<MotionFigure> motion_figures(const metrology::Identification& found,
                                         const metrology::Identifiability& knowledge);

/// A sentence for each tolerance that meets no figure: what was not judged must not pass for good.
std::vector<std::string> unmet(const std::vector<Tolerance>& tolerances,
                               const std::vector<PositioningTest>& tests,
                               const std::vector<MotionFigure>& figures);

nlohmann::json motions_json(const std::vector<MotionFigure>& figures,
                            const std::vector<Tolerance>& tolerances);
void write_motions(report::Page& page, const std::vector<MotionFigure>& figures,
                   const std::vector<Tolerance>& tolerances);
/// The verdicts alone where `brief`.
void print_motions(const std::vector<MotionFigure>& figures, const std::vector<Tolerance>& tolerances,
                   bool brief, std::ostream& out);

}  // namespace invar::tools
