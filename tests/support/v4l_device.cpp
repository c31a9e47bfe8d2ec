#include "tests/support/v4l_device.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <vector>

namespace invar::support {

namespace {

constexpr std::uint32_t page = 1U << 20;  // of the file, for each buffer: no frame here is larger

std::atomic<int> file{-1};  // that stands for the device; its buffers are its contents
std::uint32_t buffers = 0, next = 0;

int fail(int error) {
  errno = error;
  return -1;
}

std::uint32_t frame_size() { return 2 * v4l_device().width * v4l_device().height; }

int give_frame(v4l2_buffer& buffer) {
  V4lDevice& device = v4l_device();
  if (device.unplugged_after >= 0 && device.frames >= device.unplugged_after) return fail(ENODEV);
  ::usleep(3000);
  buffer.index = next++ % buffers;
  buffer.bytesused = buffer.length = frame_size();
  std::vector<std::uint8_t> pixels(buffer.bytesused, std::uint8_t{128});  // no colour
  const auto grey = static_cast<std::uint8_t>(16 + 20 * (device.frames % 10));
  for (std::size_t k = 0; k < pixels.size(); k += 2) pixels[k] = grey;
  if (::pwrite(file, pixels.data(), pixels.size(), static_cast<off_t>(buffer.index) * page) < 0) return -1;
  ++device.frames;
  return 0;
}

int answer(unsigned long request, void* argument) {
  V4lDevice& device = v4l_device();
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& found = *static_cast<v4l2_capability*>(argument);
      found = {};
      std::strcpy(reinterpret_cast<char*>(found.driver), "simulated");
      std::strcpy(reinterpret_cast<char*>(found.card), "Simulated camera");
      found.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_DEVICE_CAPS;
      found.device_caps =
          device.captures ? V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING : V4L2_CAP_META_CAPTURE;
      return 0;
    }
    case VIDIOC_S_FMT: {
      if (device.busy) return fail(EBUSY);
      auto& format = static_cast<v4l2_format*>(argument)->fmt.pix;
      device.width = format.width;
      device.height = format.height;
    }
      [[fallthrough]];
    case VIDIOC_G_FMT:
    case VIDIOC_TRY_FMT: {
      auto& format = *static_cast<v4l2_format*>(argument);
      format.fmt.pix = {};
      format.fmt.pix.width = device.width;
      format.fmt.pix.height = device.height;
      format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
      format.fmt.pix.field = V4L2_FIELD_NONE;
      format.fmt.pix.bytesperline = 2 * device.width;
      format.fmt.pix.sizeimage = frame_size();
      return 0;
    }
    case VIDIOC_REQBUFS: {
      auto& wanted = *static_cast<v4l2_requestbuffers*>(argument);
      if (device.busy) return fail(EBUSY);
      if (wanted.memory != V4L2_MEMORY_MMAP) return fail(EINVAL);
      buffers = wanted.count;
      next = 0;
      return ::ftruncate(file, static_cast<off_t>(buffers) * page);
    }
    case VIDIOC_QUERYBUF: {
      auto& buffer = *static_cast<v4l2_buffer*>(argument);
      buffer.length = frame_size();
      buffer.m.offset = buffer.index * page;
      return buffer.index < buffers ? 0 : fail(EINVAL);
    }
    case VIDIOC_DQBUF:
      return give_frame(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_QBUF:
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
      return 0;
    default:
      return fail(ENOTTY);  // frame rates, controls, inputs: it has none
  }
}

}  // namespace

V4lDevice& v4l_device() {
  static V4lDevice device;
  return device;
}

}  // namespace invar::support

extern "C" int open(const char* path, int flags, ...) {
  using Open = int (*)(const char*, int, ...);
  static const auto real = reinterpret_cast<Open>(::dlsym(RTLD_NEXT, "open"));
  if (std::strcmp(path, invar::support::V4lDevice::path) == 0)
    return invar::support::file = ::memfd_create("camera", 0);
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  return real(path, flags, mode);
}

extern "C" int ioctl(int file, unsigned long request, ...) noexcept {
  using Ioctl = int (*)(int, unsigned long, ...);
  static const auto real = reinterpret_cast<Ioctl>(::dlsym(RTLD_NEXT, "ioctl"));
  std::va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  return file == invar::support::file ? invar::support::answer(request, argument)
                                      : real(file, request, argument);
}

extern "C" int close(int file) {
  using Close = int (*)(int);
  static const auto real = reinterpret_cast<Close>(::dlsym(RTLD_NEXT, "close"));
  int known = file;
  if (file >= 0) invar::support::file.compare_exchange_strong(known, -1);
  return real(file);
}
