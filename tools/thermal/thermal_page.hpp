// The figures and the HTML page of a thermal calibration.
#pragma once

#include <filesystem>

#include "core/metrology/thermal/thermal_identification.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct ThermalFigures {
  double before = 0.0;  // m, readings against the model of the coldest temperature
  double after = 0.0;   // m, RMS of readings left out
  double sigma = 0.0;   // m, mean sigma of the systematic value
  report::LeftOut left_out;
};

ThermalFigures thermal_figures(const metrology::ThermalReadings& readings, const metrology::ThermalFit& fit);

report::Page thermal_page(const std::filesystem::path& recording, const metrology::ThermalReadings& readings,
                          const metrology::ThermalFit& fit, const ThermalFigures& figures);

}  // namespace invar::tools
