#include "tools/diagnose/report_folder.hpp"

#include <fstream>

#include "core/base/fault.hpp"

namespace invar::diagnosis {

ReportFolder::ReportFolder(std::filesystem::path folder) : folder_{std::move(folder)} {
  std::error_code failed;
  is_new_ = std::filesystem::create_directories(folder_, failed);
  if (failed)
    throw InputError{folder_.string(), "cannot be made: " + failed.message(), "choose another --out"};
  try {
    for (const auto* name : {"report.json", "report.html", "patched.yaml", "retuned.yaml"}) put(name, "");
  } catch (...) {
    forget();
    throw;
  }
  files_.clear();
}

ReportFolder::~ReportFolder() { forget(); }

void ReportFolder::put(const char* name, const std::string& text) {
  auto& file = files_.emplace_back(std::make_unique<NewFile>(folder_ / name));
  std::ofstream out{file->path(), std::ios::binary};
  out << text;
  out.close();
  if (!out) file->refuse();
}

void ReportFolder::finish() {
  is_new_ = false;
  for (const auto& file : files_) file->finish();
}

void ReportFolder::forget() {
  files_.clear();
  std::error_code ignored;
  if (is_new_) std::filesystem::remove(folder_, ignored);
}

}  // namespace invar::diagnosis
