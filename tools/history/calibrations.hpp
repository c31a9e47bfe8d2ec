// The calibrations that lie in a folder: their kind, when they were made, and the numbers that can be compared.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace invar::tools {

/// A number of a calibration at a place: EXX at x = 0.1 m.
struct CalibratedNumber {
  std::string name;
  std::string place;  // empty: the number has none
  std::string unit;
  double value = 0.0;
  double sigma = 0.0;     // NaN: not known
  bool is_error = false;  // what the machine would be off by: counts for a wanted accuracy
};

struct Calibration {
  std::filesystem::path file;  // compensation.yaml, camera.yaml or patched.yaml
  std::string kind;            // "geometric", "thermal of x", "rotary of c" ...
  double time = 0.0;           // s since 1970, UTC
  std::string time_from;       // "the folder's name", "report.json", "the file's date"
};

struct FoundCalibrations {
  std::vector<Calibration> all;                                         // by time
  std::vector<std::pair<std::filesystem::path, std::string>> left_out;  // with why
};

/// Every calibration below a folder. When it was made says the name of a folder above it that begins with a date
/// (2026-11-27, 2026-11-27T0930), else report.json (`calibrated_at`), else the file's own date.
FoundCalibrations find_calibrations(const std::filesystem::path& folder);

/// The numbers of calibrations of one kind, each at the same places, which all of them cover. One list a calibration, in
/// the same order; a number that one of them lacks is in none. Throws InputError where they cannot be compared.
std::vector<std::vector<CalibratedNumber>> comparable_numbers(const std::vector<Calibration>& calibrations);

/// "2026-11-27 09:30" in UTC.
std::string time_text(double seconds);

}  // namespace invar::tools
