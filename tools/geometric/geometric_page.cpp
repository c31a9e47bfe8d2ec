// The HTML page of a geometric calibration.
#include "tools/geometric/geometric_report.hpp"

namespace invar::tools {

report::Page report_page(const GeometricResult& result) {
  report::Page page{"Geometric calibration", result.lines_file.filename().string()};
  page.callout("Error on the lines: " + report::si(result.before_rms, "m") + " before, " +
               report::si(result.after_rms, "m") + " after (RMS)");
  return page;
}

}  // namespace invar::tools
