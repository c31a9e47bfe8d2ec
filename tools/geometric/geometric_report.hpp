// Result of a geometric calibration: evaluated on points not fitted, as JSON, as a page, as a few printed lines.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/identifiability.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tools/geometric/diagonals.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/geometric/motion_figures.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// One line before and after compensation [m]: RMS and largest error of displacement.
struct LineFigures {
  double before_rms = 0.0, before_max = 0.0;
  double after_rms = 0.0, after_max = 0.0;    // with this line among those fitted
  double unseen_rms = 0.0, unseen_max = 0.0;  // predicted from the other lines alone
};

/// Accuracy at a coarser data interval, from the same readings.
struct IntervalFigures {
  double interval = 0.0;  // m, along the longest line
  int points = 0;
  double points_rms = 0.0;    // m, over all points, those left out included
  double expected_rms = 0.0;  // m, over the volume
  double integral =
      0.0;  // m^2, of the error's size along the first of the longest lines, as in table 2.3 of the thesis
};

/// A line that was read at one point only: how far the surroundings move a reading there (ISO 230-3).
struct DriftAtOnePoint {
  std::string line;
  int readings = 0;
  double range = 0.0;  // m, largest less smallest
  double end = 0.0;    // m, last less first
};

struct GeometricResult {
  std::filesystem::path machine_file, lines_file;
  std::string method;
  metrology::Machine machine;
  LinesFile input;
  metrology::Identification found;
  metrology::Identifiability knowledge;
  std::vector<metrology::NextLine> next;   // that would help most
  std::vector<IntervalFigures> intervals;  // filled by study_intervals
  std::vector<LineFigures> figures;        // by line
  std::vector<PositioningTest> tests;      // by ISO 230-2 and -6
  std::vector<MotionFigure> motions;       // by ISO 230-1
  std::vector<DiagonalFigures> diagonals;  // by ISO 230-6
  std::vector<Tolerance> tolerances;
  std::vector<std::string> not_judged;  // tolerances without a figure
  std::vector<DriftAtOnePoint> drifts;
  std::vector<Eigen::VectorXd> rest;  // by line and point: measured minus model, m; NaN for points left out
  std::vector<Eigen::VectorXd>
      unseen;  // the same predicted from the other lines alone; empty where impossible
  double before_rms = 0.0, after_rms = 0.0, unseen_rms = 0.0, unseen_max = 0.0;  // m, over all lines
};

/// In millionths (um, urad), to a thousandth of one: what is less than that is "0".
std::string micro(double value, int digits = 3);

/// Fills the figures from `found`: each line also predicted from the others alone.
void evaluate(GeometricResult& result);

/// Figures of ISO 230-1, -2 and -6, drift at one point; after `evaluate`. `device` of 1 and `environment` [m] are standard uncertainties; where
/// the latter is not given (negative), the drift at one point gives it: a range is 2 sqrt(3) of one.
void test_positioning(GeometricResult& result, double device, double environment);

/// "x every 12.7 mm by 1.4 um" of each periodic error found; empty without one.
std::string wave_words(const metrology::Identification& found);

/// Accuracy against data interval (every second, fourth, eighth point of the lines), at the prior found.
void study_intervals(GeometricResult& result);
/// The coarsest interval that costs at most a tenth of the accuracy; nullptr without a study.
const IntervalFigures* interval_to_choose(const GeometricResult& result);

/// Expansion of an axis with its scale [1/K]; `known` where the readings tell it better than half of what was expected.
struct Expansion {
  std::string axis;
  double value = 0.0, sigma = 0.0;
  bool known = false;
};
std::vector<Expansion> expansions(const metrology::Identification& found);
/// One line on temperatures: range, reference, expansion; empty without the column.
std::string temperature_words(const GeometricResult& result);

nlohmann::json report_json(const GeometricResult& result);
report::Page report_page(const GeometricResult& result);
void print_summary(const GeometricResult& result, std::ostream& out);
/// Method, prior and noise, for the reader of the model file.
void describe_identification(const GeometricResult& result, compensation::ModelText& text);

}  // namespace invar::tools
