// The folder of a diagnosis: all of its files appear, or none.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/base/new_file.hpp"

namespace invar::diagnosis {

class ReportFolder {
 public:
  /// Throws InputError where it takes no files; so it is said before a long search.
  explicit ReportFolder(std::filesystem::path folder);
  ~ReportFolder();  // what is not finished goes, also a folder that was made for it
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

  void put(const char* name, const std::string& text);
  void finish();

 private:
  void forget();

  std::filesystem::path folder_;
  bool is_new_ = false;
  std::vector<std::unique_ptr<NewFile>> files_;
};

}  // namespace invar::diagnosis
