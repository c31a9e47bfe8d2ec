// Rows that a calibration left out of its fit, and the cost of that: on the page, in report.json and on the console.
#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/report/page.hpp"

namespace invar::report {

/// The rows of a calibration: how many there were, how many were used, and why the others were not. The error of the model
/// is given over the used ones and over all that have a value.
struct LeftOut {
  struct Reason {
    std::size_t count = 0;
    std::string why;
  };
  std::string row = "reading";  // one of them
  std::size_t given = 0;
  std::size_t used = 0;
  std::vector<Reason> reasons;  // those with a count of 0 are not shown
  std::string unit = "m";
  double rms_used = std::numeric_limits<double>::quiet_NaN();  // NaN: cannot be told
  double rms_all = std::numeric_limits<double>::quiet_NaN();
  /// Errors that no model here explains, and properties that were not tested: sentences.
  std::vector<std::string> unexplained;
  /// The rows that were left out, one by one; the first of them are shown.
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// A section of the page.
void show(Page& page, const LeftOut& left_out);
/// `given`, `used`, `left_out` [{count, why}], `rms_used` and `rms_all` in `unit` (absent where they cannot be told),
/// `unexplained`.
[[nodiscard]] nlohmann::json json_of(const LeftOut& left_out);
/// "1980 readings, 1978 used (2 outliers that stand alone); error 0.5 um over those used, 0.8 um over all"
[[nodiscard]] std::string line_of(const LeftOut& left_out);

/// RMS; NaN for none.
[[nodiscard]] double rms_of(const std::vector<double>& values);

}  // namespace invar::report
