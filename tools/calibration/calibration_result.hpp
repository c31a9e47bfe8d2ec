// Files of every calibration: compensation.yaml, report.json, report.html - all three or none.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/compensation/model_file.hpp"
#include "core/recording/table.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// Says on a terminal what is being done, and clears it when that is over; silent in a pipe.
class Progress {
 public:
  explicit Progress(const std::string& what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
};

/// Makes the folder and writes the three files into it. Throws InputError where that fails.
void write_calibration(const std::filesystem::path& folder, const compensation::ModelText& model,
                       const nlohmann::json& report, const report::Page& page);

/// The same with a model of another kind, under the name that it has.
void write_calibration(const std::filesystem::path& folder, const std::string& name, const std::string& model,
                       const nlohmann::json& report, const report::Page& page);

/// The reports alone, of readings that give no model.
void write_reports(const std::filesystem::path& folder, const nlohmann::json& report,
                   const report::Page& page);

/// The time now as report.json has it: "2026-11-27T09:30:00Z".
std::string calibrated_at();

/// "wrote DIR/compensation.yaml, DIR/report.json, DIR/report.html": each may be opened as it stands.
std::string written(const std::filesystem::path& folder, const std::string& name);

/// A column as a vector.
inline Eigen::VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Throws InputError naming the file, the column and the row (of the file's data, from 1) of the first value
/// that is missing, infinite or beyond `largest` in size.
void expect_finite(const std::filesystem::path& file, const std::string& column,
                   const std::vector<double>& values, double largest);

}  // namespace invar::tools
