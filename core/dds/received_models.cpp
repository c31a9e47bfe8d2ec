#include "core/dds/received_models.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/new_file.hpp"
#include "core/component/cell_folders.hpp"

namespace invar::dds {

namespace {

namespace fs = std::filesystem;
constexpr std::size_t most_files = 100;  // beside those that are given up for newer ones
constexpr std::string_view folder_prefix = "model-";

/// FNV-1a: a name, not a seal.
std::string name_of(std::string_view text) {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  char digits[20];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return std::string{folder_prefix} + digits + ".yaml";
}

void remove_oldest(const fs::path& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  for (const auto& entry : fs::directory_iterator{folder})
    if (entry.path().filename().string().starts_with(folder_prefix))
      files.emplace_back(entry.last_write_time(), entry.path());
  if (files.size() <= most_files) return;
  std::sort(files.begin(), files.end());
  for (std::size_t i = 0; i + most_files < files.size(); ++i) fs::remove(files[i].second);
}

}  // namespace

ReceivedModels::Kept ReceivedModels::keep(std::span<const std::uint8_t> bytes) const {
  const std::string_view text{reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  if (folder_.empty()) return {{}, "this process takes no models"};
  if (!is_model_text(text)) return {{}, "it is neither a model.yaml nor a compensation.yaml"};
  const fs::path file = fs::absolute(folder_) / name_of(text);
  try {
    fs::create_directories(folder_);
    write_file(file, std::string{text});
    remove_oldest(folder_);
  } catch (const std::exception& error) {
    return {{}, std::string{"the model cannot be kept: "} + error.what()};
  }
  return {file, ""};
}

}  // namespace invar::dds
