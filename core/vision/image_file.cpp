#include "core/vision/image_file.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cstdio>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/input_file.hpp"
#include "core/base/limits.hpp"
#include "core/vision/droplets.hpp"
#include "core/vision/image_header.hpp"

namespace invar::vision {

namespace {

// libpng and libjpeg print to file descriptor 2 whatever they dislike.
class QuietStderr {
 public:
  QuietStderr() : kept_{dup(2)} {
    const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept_ >= 0 && nothing >= 0) dup2(nothing, 2);
    if (nothing >= 0) close(nothing);
  }
  ~QuietStderr() {
    if (kept_ < 0) return;
    dup2(kept_, 2);
    close(kept_);
  }
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;

 private:
  int kept_;
};

std::vector<unsigned char> bytes_of(const std::filesystem::path& file) {
  std::error_code error;
  const auto kind = std::filesystem::status(file, error).type();
  if (kind == std::filesystem::file_type::not_found)
    throw InputError{file.string(), "no such image file", "check the path"};
  if (kind == std::filesystem::file_type::directory)
    throw InputError{file.string(), "is a folder, not an image", "name a file"};
  // zlib reads plain files as they are.
  gzFile in = gzdopen(open_input(file, "an image"), "rb");
  if (in == nullptr) throw InputError{file.string(), "the image cannot be read", "check its permissions"};
  std::vector<unsigned char> bytes;
  std::array<unsigned char, 65536> part{};
  int n = 0;
  while ((n = gzread(in, part.data(), static_cast<unsigned>(part.size()))) > 0) {
    bytes.insert(bytes.end(), part.begin(), part.begin() + n);
    if (bytes.size() <= limits::image_file) continue;
    gzclose_r(in);
    throw InputError{file.string(),
                     "has more than " + std::to_string(limits::image_file / limits::mib) + " MiB",
                     "name an image file"};
  }
  const bool broken = n < 0;
  const bool cut = gzclose_r(in) != Z_OK;
  if (broken || cut)
    throw InputError{file.string(), "the image cannot be read to its end", "it is truncated or damaged"};
  if (bytes.empty()) throw InputError{file.string(), "the image is empty (0 bytes)", "write it again"};
  return bytes;
}

bool starts_with(const std::vector<unsigned char>& bytes, const std::string& text) {
  return bytes.size() >= text.size() &&
         std::equal(text.begin(), text.end(), bytes.begin(),
                    [](char a, unsigned char b) { return static_cast<unsigned char>(a) == b; });
}

constexpr const char* formats = "give a PNG, JPEG, TIFF, BMP or PGM file";

/// A few bytes may say that they are a picture of a thousand megabytes.
void check_size(const std::vector<unsigned char>& bytes, const std::filesystem::path& file) {
  const auto header = image_header(bytes);
  if (!header) throw InputError{file.string(), "is no image that can be decoded", formats};
  constexpr std::uint64_t longest_side = 1U << 20U;
  if (header->width <= longest_side && header->height <= longest_side &&
      header->width * header->height <= limits::image_pixels && header->pixel_bytes <= 64 &&
      header->bytes() <= limits::image_unpacked)
    return;
  throw InputError{
      file.string(),
      "says that it has " + std::to_string(header->width) + " x " + std::to_string(header->height) +
          " pixels of " + std::to_string(header->pixel_bytes) + " bytes",
      "images of up to " + std::to_string(limits::image_pixels / 1'000'000) + " million pixels and " +
          std::to_string(limits::image_unpacked / limits::gib) + " GiB are read: cut it into several"};
}

}  // namespace

cv::Mat read_gray_image(const std::filesystem::path& file) {
  const auto bytes = bytes_of(file);
  check_size(bytes, file);
  cv::Mat image;
  {
    QuietStderr quiet;
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    try {
      image = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
    } catch (const cv::Exception&) {
      image.release();  // what it dislikes, or has no memory for
    }
  }
  if (image.empty()) throw InputError{file.string(), "is no image that can be decoded", formats};
  // A decoder fills what is missing of a cut JPEG with grey: measuring that would be wrong without a word.
  if (starts_with(bytes, "\xff\xd8")) {
    std::size_t end = bytes.size();
    while (end > 2 && bytes[end - 1] == 0) --end;
    if (end < 4 || bytes[end - 2] != 0xff || bytes[end - 1] != 0xd9)
      throw InputError{file.string(), "the image is truncated", "write it again"};
  }
  if (image.cols < 16 || image.rows < 16)
    throw InputError{
        file.string(),
        "the image has only " + std::to_string(image.cols) + " x " + std::to_string(image.rows) + " pixels",
        "at least 16 x 16 are needed"};
  return gray(image);
}

}  // namespace invar::vision
