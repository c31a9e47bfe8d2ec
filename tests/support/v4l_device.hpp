// A camera of Video4Linux where there is none: this program's calls of open and ioctl are answered as a driver would answer them.
#pragma once

#include <atomic>
#include <cstdint>

namespace invar::support {

/// What the driver of the one camera, /dev/video-simulated, does. Its frames are grey all over: 16 + 20 k in the k-th, YUYV.
struct V4lDevice {
  static constexpr const char* path = "/dev/video-simulated";
  std::atomic<bool> captures{true};                    // false: a device for something else
  std::atomic<bool> busy{false};                       // another program streams from it
  std::atomic<int> unplugged_after{-1};                // frames; -1: never
  std::atomic<std::uint32_t> width{640}, height{480};  // px; as asked for by the reader
  std::atomic<int> frames{0};                          // given so far
};
V4lDevice& v4l_device();

}  // namespace invar::support
