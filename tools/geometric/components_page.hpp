// The HTML page of error motions that were measured one by one.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/metrology/component_identification.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct ComponentsResult {
  std::filesystem::path machine_file;
  std::filesystem::path readings_file;
  metrology::ComponentNetworks model;
  std::array<std::optional<metrology::ComponentReadings>, metrology::component_count> readings;
  std::array<std::optional<metrology::ComponentFit>, metrology::component_count> fits;
  std::size_t rows = 0;
  double field_rms = 0.0;    // m, of the error over the travels in the usual state
  double field_sigma = 0.0;  // m, RMS of what is not known of it there
  std::vector<std::string> unidentified;
  std::vector<std::string> notes;

  /// "temperature, heating_rate" or "position alone".
  [[nodiscard]] std::string depends_on(int component) const;
};

/// Reading minus fit, RMS over the readings used or over all of them.
double rms_of_readings(const metrology::ComponentFit& fit, bool all);
/// Errors stand with each component: they are lengths of one and angles of another.
report::LeftOut rows_of(const ComponentsResult& result);

report::Page components_page(const ComponentsResult& result);

}  // namespace invar::tools
