// The HTML page of error motions that were measured one by one.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/geometric/error_motion_identification.hpp"
#include "tools/geometric/motion_figures.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct ComponentsResult {
  std::filesystem::path machine_file;
  std::filesystem::path readings_file;
  metrology::ErrorMotionNetworks model;
  MotionReadings readings;
  MotionFits fits;
  std::size_t rows = 0;
  double field_rms = 0.0;    // m, of the error over the travels in the usual state
  double field_sigma = 0.0;  // m, RMS of what is not known of it there
  std::vector<std::string> unidentified;
  std::vector<std::string> notes;
  std::vector<PositioningTest> tests;  // of motions with targets read more than once, by ISO 230-2
  std::vector<MotionFigure> motions;   // by ISO 230-1
  std::vector<Tolerance> tolerances;
  std::vector<std::string> not_judged;  // tolerances without a figure

  /// "temperature, heating_rate" or "position alone".
  [[nodiscard]] std::string depends_on(int component) const;
};

/// Reading minus fit, RMS over the readings used or over all of them.
double rms_of_readings(const metrology::ErrorMotionFit& fit, bool all);
/// Errors stand with each component: they are lengths of one and angles of another.
report::LeftOut rows_of(const ComponentsResult& result);

report::Page components_page(const ComponentsResult& result);

}  // namespace invar::tools
