#include "tools/history/calibrations.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>

#include "core/base/fault.hpp"
#include "core/compensation/model_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "core/config/yaml.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;

/// A date at the beginning of a text; nothing where there is none, or no such day.
std::optional<double> date_of(const std::string& text) {
  static const std::regex form{
      R"(^(\d{4})-(\d{2})-(\d{2})(?:[T _-]?(\d{2})[:.-]?(\d{2})(?:[:.-]?(\d{2}))?)?.*)"};
  std::smatch found;
  if (!std::regex_match(text, found, form)) return std::nullopt;
  const auto part = [&](std::size_t k) { return found[k].matched ? std::stoi(found[k].str()) : 0; };
  const std::chrono::year_month_day day{std::chrono::year{part(1)} / part(2) / part(3)};
  if (!day.ok() || part(4) > 23 || part(5) > 59 || part(6) > 59) return std::nullopt;
  const auto days = std::chrono::sys_days{day}.time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600.0 * part(4) + 60.0 * part(5) + part(6);
}

nlohmann::json report_beside(const fs::path& file) {
  std::ifstream stream{file.parent_path() / "report.json"};
  return stream ? nlohmann::json::parse(stream, nullptr, false) : nlohmann::json{};
}

void tell_time(Calibration& calibration, const fs::path& folder) {
  for (fs::path at = calibration.file.parent_path();
       at != folder && at.has_relative_path() && at != at.parent_path(); at = at.parent_path())
    if (const auto date = date_of(at.filename().string())) {
      calibration.time = *date;
      calibration.time_from = "the folder's name";
      return;
    }
  const auto report = report_beside(calibration.file);
  if (report.is_object() && report.contains("calibrated_at") && report["calibrated_at"].is_string())
    if (const auto date = date_of(report["calibrated_at"].get<std::string>())) {
      calibration.time = *date;
      calibration.time_from = "report.json";
      return;
    }
  const auto file_time = fs::last_write_time(calibration.file);
  const auto now = std::chrono::system_clock::now() + (file_time - fs::file_time_type::clock::now());
  calibration.time = std::chrono::duration<double>(now.time_since_epoch()).count();
  calibration.time_from = "the file's date";
}

/// What kind of calibration a file is, an axis beside it where the model has one. Throws InputError where it is none.
std::string kind_of(const fs::path& file) {
  if (file.filename() == "patched.yaml") {
    const auto report = report_beside(file);
    if (report.is_object() && report.value("kind", "") == "ripple") return "ripple";
    return "";  // a diagnosis's
  }
  const auto yaml = config::Yaml::load(file);
  compensation::check_seal(yaml);
  if (file.filename() == "camera.yaml")
    return "camera, " + (yaml.root().has("model") ? yaml.root()["model"].as_text() : std::string{"scale"});
  const std::string kind = yaml.root().text("kind");
  if (kind == "rotary") return kind + " of " + yaml.root().text("axis");
  if (kind != "thermal") return kind;
  const auto place = compensation::read_place(yaml.root());
  return place.axis ? kind + " of " + "xyz"[*place.axis] : kind;
}

}  // namespace

FoundCalibrations find_calibrations(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw InputError{folder.string(), "is no folder", "name the folder that holds the calibrations' folders"};
  std::vector<fs::path> files;
  for (const auto& entry :
       fs::recursive_directory_iterator{folder, fs::directory_options::skip_permission_denied}) {
    const auto name = entry.path().filename();
    if (entry.is_regular_file() &&
        (name == "compensation.yaml" || name == "camera.yaml" || name == "patched.yaml"))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  FoundCalibrations found;
  for (const auto& file : files) {
    try {
      Calibration calibration{file, kind_of(file), 0.0, ""};
      if (calibration.kind.empty()) continue;
      tell_time(calibration, folder);
      found.all.push_back(std::move(calibration));
    } catch (const InputError& fault) {
      found.left_out.emplace_back(file, fault.what());
    }
  }
  std::stable_sort(found.all.begin(), found.all.end(),
                   [](const Calibration& a, const Calibration& b) { return a.time < b.time; });
  return found;
}

std::string time_text(double seconds) {
  const auto when = static_cast<std::time_t>(seconds);
  std::tm parts{};
  gmtime_r(&when, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M", &parts);
  return text;
}

}  // namespace invar::tools
