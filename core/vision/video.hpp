// Video: the pictures of a device or of a video file, behind an interface without OpenCV, which libinvar_video.so brings.
#pragma once

#include <memory>
#include <string>

#include "core/vision/pixels.hpp"

namespace invar::vision {

class Video {
 public:
  virtual ~Video() = default;
  /// Waits for the next picture, grey of 8 bits. False: there is none any more.
  virtual bool read(Pixels& pixels) = 0;
  /// Rate of a file [Hz].
  [[nodiscard]] virtual double rate() const = 0;
};

struct VideoRequest {
  std::string place;  // a device of Video4Linux, or a file
  bool is_file = false;
  std::int64_t width = 0, height = 0;  // px; 0: what the device has
};

/// nullptr where it cannot be opened. Loads the library at the first call; throws InputError where that fails. Set-up only.
std::unique_ptr<Video> open_video(const VideoRequest& request);

}  // namespace invar::vision
