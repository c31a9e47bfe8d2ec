// VisionLibrary: what needs OpenCV, behind functions without it. Its 140 shared libraries come into a process at the first use.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "core/vision/annotate.hpp"
#include "core/vision/droplets.hpp"
#include "core/vision/pixels.hpp"
#include "core/vision/ruler.hpp"
#include "core/vision/scene.hpp"

namespace invar::vision {

/// Pictures may have 8 or 16 bits a pixel; each function says in its own header what it does.
struct VisionLibrary {
  Pixels (*read)(const std::filesystem::path& file);  // image_file.hpp
  Pixels (*render)(const Scene& scene);               // render.hpp
  Droplets (*measure)(const PixelsView& picture, const MeasureOptions& options);
  std::optional<RulerFit> (*calibrate)(const PixelsView& picture, const std::vector<double>& radii,
                                       RulerFailure& failure);
  /// The bytes of a PNG file, annotate.hpp.
  std::vector<unsigned char> (*draw_outlines)(const PixelsView& picture,
                                              const std::vector<AnnotatedOutline>& outlines);
  std::vector<unsigned char> (*draw_droplets)(const PixelsView& picture, const Droplets& droplets,
                                              const std::vector<AnnotatedTarget>& targets);
};

/// Loads the library at the first call, which takes about a tenth of a second. Throws InputError where that fails. Set-up only.
const VisionLibrary& library();

}  // namespace invar::vision
