// What a geometric calibration found: evaluated on points not fitted, as JSON, as a page, as a few printed lines.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric_identification.hpp"
#include "core/metrology/identifiability.hpp"
#include "core/metrology/line_plan.hpp"
#include "tools/geometric/lines_file.hpp"
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
  std::vector<Eigen::VectorXd> unseen;     // by line: measured minus predicted from the others, m
  double before_rms = 0.0, after_rms = 0.0, unseen_rms = 0.0, unseen_max = 0.0;  // m, over all lines
};

/// Fills the figures from `found`: each line also predicted from the others alone.
void evaluate(GeometricResult& result);

/// Accuracy against data interval (every second, fourth, eighth point of the lines), at the prior found.
void study_intervals(GeometricResult& result);

nlohmann::json report_json(const GeometricResult& result);
report::Page report_page(const GeometricResult& result);
void print_summary(const GeometricResult& result, std::ostream& out);
/// Method, prior and noise, for whoever reads the model file.
void describe_identification(const GeometricResult& result, compensation::ModelText& text);

}  // namespace invar::tools
