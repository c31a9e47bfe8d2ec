// The one function that libinvar_vision.so offers: its table.
#include "core/vision/image_file.hpp"
#include "core/vision/library.hpp"
#include "core/vision/mat.hpp"
#include "core/vision/render.hpp"

namespace {

using namespace invar::vision;

constexpr VisionLibrary table{
    .read = [](const std::filesystem::path& file) { return pixels_of(read_gray_image(file)); },
    .render = [](const Scene& scene) { return pixels_of(render(scene)); },
    .measure = [](const PixelsView& picture,
                  const MeasureOptions& options) { return measure_droplets(gray(mat_of(picture)), options); },
    .calibrate = [](const PixelsView& picture, const std::vector<double>& radii,
                    RulerFailure& failure) { return calibrate_ruler(gray(mat_of(picture)), radii, failure); },
    .draw_outlines =
        [](const PixelsView& picture, const std::vector<AnnotatedOutline>& outlines) {
          return encode_png(annotate(gray(mat_of(picture)), outlines));
        },
    .draw_droplets =
        [](const PixelsView& picture, const Droplets& droplets, const std::vector<AnnotatedTarget>& targets) {
          return encode_png(annotate(gray(mat_of(picture)), droplets, targets));
        }};

}  // namespace

extern "C" __attribute__((visibility("default"))) const invar::vision::VisionLibrary& invar_vision_library() {
  return table;
}
