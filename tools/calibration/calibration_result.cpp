#include "tools/calibration/calibration_result.hpp"

#include <unistd.h>

#include <cmath>
#include <ctime>
#include <iostream>

#include "core/base/new_file.hpp"
#include "tools/live/terminal.hpp"

namespace invar::tools {

Progress::Progress(const std::string& what) {
  if (isatty(STDERR_FILENO) != 0) std::cerr << what << " ..." << std::flush;
}

Progress::~Progress() {
  if (isatty(STDERR_FILENO) != 0) steer(std::cerr, clear_line);
}

std::string calibrated_at() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

void write_reports(const std::filesystem::path& folder, const nlohmann::json& report,
                   const report::Page& page) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed || !std::filesystem::is_directory(folder))
    throw InputError{folder.string(), "cannot be made", "name a folder that may be written to"};
  page.write(folder / "report.html");
  nlohmann::json dated = report;
  dated["calibrated_at"] = calibrated_at();
  write_file(folder / "report.json", dated.dump(1) + "\n");
}

void write_calibration(const std::filesystem::path& folder, const compensation::ModelText& model,
                       const nlohmann::json& report, const report::Page& page) {
  write_reports(folder, report, page);
  model.write(folder / "compensation.yaml");  // last: where it is, all is there
}

std::string written(const std::filesystem::path& folder, const std::string& name) {
  return "wrote " + (folder / name).string() + ", " + (folder / "report.json").string() + ", " +
         (folder / "report.html").string();
}

void write_calibration(const std::filesystem::path& folder, const std::string& name, const std::string& model,
                       const nlohmann::json& report, const report::Page& page) {
  write_reports(folder, report, page);
  write_file(folder / name, model);
}

void expect_finite(const std::filesystem::path& file, const std::string& column,
                   const std::vector<double>& values, double largest) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i]) && std::abs(values[i]) <= largest) continue;
    const std::string where = file.string() + ": column `" + column + "`, row " + std::to_string(i + 1);
    if (!std::isfinite(values[i]))
      throw InputError{where, "is empty, nan or not finite", "remove the row or fill the value in"};
    throw InputError{where, report::number(values[i], 6) + " is out of range",
                     "check the value and its unit"};
  }
}

}  // namespace invar::tools
