#include "core/component/cell_folders.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>

namespace invar {

namespace {

namespace fs = std::filesystem;

/// Far more than a model with networks for six axes has; a file that is larger is none.
constexpr std::uintmax_t largest_model = 16U << 20U;

/// `file` is one of the places, or in one. Both as the file system has them, links followed.
bool is_in(const fs::path& file, const CellFolders::Places& places) {
  return std::any_of(places.begin(), places.end(), [&file](const fs::path& place) {
    std::error_code failed;
    const fs::path folder = fs::weakly_canonical(fs::absolute(place, failed), failed);
    if (failed || folder.empty()) return false;
    return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
  });
}

}  // namespace

bool is_model_text(std::string_view text) {
  for (const std::string_view key : {"invar_compensation:", "invar_model:"})
    if (text.starts_with(key) || text.find("\n" + std::string{key}) != std::string_view::npos) return true;
  return false;
}

std::optional<fs::path> CellFolders::model(const fs::path& named) const {
  std::error_code failed;
  const fs::path file = fs::canonical(named, failed);
  if (failed || !is_in(file, models_)) return std::nullopt;
  if (file.extension() != ".yaml" && file.extension() != ".yml") return std::nullopt;
  if (!fs::is_regular_file(file, failed) || fs::file_size(file, failed) > largest_model || failed)
    return std::nullopt;
  std::ifstream content{file, std::ios::binary};
  const std::string text{std::istreambuf_iterator<char>{content}, {}};
  if (!is_model_text(text)) return std::nullopt;
  return file;
}

std::optional<fs::path> CellFolders::picture(const fs::path& named) const {
  std::error_code failed;
  const fs::path file = fs::weakly_canonical(fs::absolute(named, failed), failed);
  if (failed || file.extension() != ".png" || !is_in(file, results_)) return std::nullopt;
  if (fs::exists(file, failed) && !fs::is_regular_file(file, failed)) return std::nullopt;
  return file;
}

}  // namespace invar
