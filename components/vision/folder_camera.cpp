#include "components/vision/folder_camera.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "core/base/fault.hpp"
#include "core/vision/library.hpp"

namespace invar::vision {

namespace {

bool is_picture(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 8> endings{".png",  ".jpg", ".jpeg", ".tif",
                                                    ".tiff", ".bmp", ".pgm",  ".gz"};
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

}  // namespace

FolderCamera::FolderCamera(const Parameters& parameters)
    : FrameCamera{parameters.camera}, parameters_{parameters} {
  if (parameters.folder.empty()) throw InputError{"folder", "missing", "name the folder of the pictures"};
  if (!std::filesystem::is_directory(parameters.folder))
    throw InputError{"folder", "`" + parameters.folder.string() + "` is no folder", "name a folder"};
  for (const auto& entry : std::filesystem::directory_iterator{parameters.folder})
    if (entry.is_regular_file() && is_picture(entry.path())) files_.push_back(entry.path());
  std::sort(files_.begin(), files_.end());
  if (files_.empty())
    throw InputError{"folder", "`" + parameters.folder.string() + "` holds no picture",
                     "put PNG, JPEG, TIFF, BMP or PGM files there"};
}

void FolderCamera::configure() { (void)library().read(files_.front()); }

void FolderCamera::activate() {
  FrameCamera::activate();
  next_ = 0;
}

bool FolderCamera::take_picture(const Tick&, std::uint64_t, Picture& picture) {
  if (next_ == files_.size()) {
    if (!parameters_.again) return false;
    next_ = 0;
  }
  picture.pixels = library().read(files_[next_++]);
  return true;
}

}  // namespace invar::vision
