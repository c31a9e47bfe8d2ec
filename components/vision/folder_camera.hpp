// FolderCamera: pictures of a folder instead of a camera, one after the other.
#pragma once

#include <filesystem>
#include <vector>

#include "components/vision/frame_camera.hpp"

namespace invar::vision {

/// PNG, JPEG, TIFF, BMP and PGM files by the order of their names.
class FolderCamera final : public FrameCamera {
 public:
  struct Parameters {
    CameraParameters camera;
    std::filesystem::path folder;
    bool again = false;
    void describe(auto& p) {
      camera.describe(p);
      p(folder, "folder", "folder of the pictures");
      p(again, "again", "begin anew after the last picture");
    }
  };
  explicit FolderCamera(const Parameters& parameters);
  void configure() override;
  void activate() override;

 private:
  bool take_picture(const Tick& tick, std::uint64_t number, Picture& picture) override;

  const Parameters& parameters_;
  std::vector<std::filesystem::path> files_;
  std::size_t next_ = 0;
};

}  // namespace invar::vision
