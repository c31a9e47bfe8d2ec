// Renishaw's .rtl and .pos: runs of a laser along one axis, deviations at targets, as text in sections.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace invar::tools {

/// Whether the file begins with such a section (`HEADER::`).
bool is_rtl(const std::filesystem::path& file);

/// One deviation at one target.
struct RtlReading {
  int run = 0;
  std::size_t target = 0;  // from 0
  double deviation = 0.0;  // m or rad
  int direction = 1;       // of the run, by the order of its targets
};

struct RtlFile {
  std::string axis;             // "X"; empty where the file does not say
  bool rotary = false;          // positions and deviations in rad
  std::vector<double> targets;  // m or rad
  std::vector<RtlReading> readings;
};

/// Targets in mm or deg, deviations in um or arcsec, as the file type says. Throws InputError with line and mend.
RtlFile load_rtl(const std::filesystem::path& file);

}  // namespace invar::tools
