#include "core/vision/video.hpp"

#include "core/base/library.hpp"

namespace invar::vision {

std::unique_ptr<Video> open_video(const VideoRequest& request) {
  using Entry = Video* (*)(const VideoRequest&);
  static const auto open = reinterpret_cast<Entry>(library_entry("invar_video", "invar_open_video"));
  return std::unique_ptr<Video>{open(request)};
}

}  // namespace invar::vision
