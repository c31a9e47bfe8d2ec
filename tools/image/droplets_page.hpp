// The page that shows what was measured in images of droplets.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/vision/camera.hpp"
#include "core/vision/droplets.hpp"
#include "core/vision/pixels.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct MeasuredImage {
  std::string name;
  vision::Pixels image;
  vision::Droplets droplets;
};

/// Adds to a page: counts and sizes an image, the annotated images, and the distribution of the sizes. Lengths in um
/// where a camera is given, else in px.
void add_droplets(report::Page& page, const std::vector<MeasuredImage>& images,
                  const std::optional<vision::CameraModel>& camera);

}  // namespace invar::tools
