// Image files in; faults of a file as one InputError.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>

namespace invar::vision {

/// 8-bit grey from any format that OpenCV reads (colour by luminance, 16 bits scaled to the image's range), `.gz`
/// unpacked. Throws InputError when the file is missing, empty, cut short, no image, or below 16 x 16 pixels; the
/// decoder's own messages are kept off stderr.
cv::Mat read_gray_image(const std::filesystem::path& file);

}  // namespace invar::vision
