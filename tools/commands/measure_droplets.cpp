// `invar measure droplets`: positions and sizes of droplets in images.
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "core/recording/table.hpp"
#include "core/vision/camera_file.hpp"
#include "core/vision/library.hpp"
#include "tools/command.hpp"
#include "tools/image/droplets_page.hpp"

namespace invar::tools {

namespace {

struct MeasureDropletsOptions {
  std::vector<std::filesystem::path> images;
  std::optional<std::filesystem::path> camera;
  double distance = 0.0;
  std::filesystem::path output;
  std::optional<std::filesystem::path> report;
};

struct Rows {
  std::vector<std::string> image, status;
  std::vector<double> x, y, radius, circularity, score, sigma, x_metres, y_metres, diameter;
};

void measure(const MeasureDropletsOptions& options) {
  std::optional<vision::CameraModel> camera;
  if (options.camera) camera = vision::read_camera(*options.camera, options.distance);
  // Every image is read before anything is measured: a bad one must not cost the time of the good ones.
  std::vector<vision::Pixels> images;
  for (const auto& file : options.images) images.push_back(vision::library().read(file));

  Rows rows;
  std::vector<MeasuredImage> shown;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const vision::Droplets found = vision::library().measure(images[i].view(), {});
    for (const vision::Droplet& drop : found.droplets) {
      rows.image.push_back(options.images[i].string());
      rows.status.emplace_back(vision::name(drop.status));
      rows.x.push_back(drop.x);
      rows.y.push_back(drop.y);
      rows.radius.push_back(drop.radius);
      rows.circularity.push_back(drop.circularity);
      rows.score.push_back(drop.score);
      rows.sigma.push_back(drop.sigma);
      if (!camera) continue;
      const Eigen::Vector2d at = camera->to_metres({drop.x, drop.y});
      rows.x_metres.push_back(at.x());
      rows.y_metres.push_back(at.y());
      rows.diameter.push_back(2.0 * drop.radius * camera->local_scale({drop.x, drop.y}));
    }
    if (options.report) shown.push_back({options.images[i].filename().string(), images[i], found});
    std::cout << options.images[i].string() << ": " << found.sound()
              << " droplets; not counted: " << found.droplets.size() - found.sound()
              << " (satellites, dust, cut by the border)\n";
  }
  recording::Table table;
  table.add_texts("image", rows.image);
  table.add("x", "px", rows.x);
  table.add("y", "px", rows.y);
  table.add("radius", "px", rows.radius);
  table.add("circularity", "", rows.circularity);
  table.add("score", "", rows.score);
  table.add_texts("status", rows.status);
  table.add("sigma", "px", rows.sigma);
  if (camera) {
    table.add("x", "m", rows.x_metres);
    table.add("y", "m", rows.y_metres);
    table.add("diameter", "m", rows.diameter);
  }
  table.write(options.output);
  if (options.report) {
    report::Page page{"Droplets",
                      std::to_string(images.size()) + (images.size() == 1 ? " image" : " images")};
    add_droplets(page, shown, camera);
    page.write(*options.report);
  }
  std::cout << "wrote " << options.output.string();
  if (options.report) std::cout << ", " << options.report->string();
  std::cout << '\n';
}

}  // namespace

void add_measure(CLI::App& program) {
  auto* group = program.add_subcommand("measure", "Measure what images show");
  group->require_subcommand(1);
  group->footer("Example: invar measure droplets --image print.png --output droplets.csv");
  auto* command =
      group->add_subcommand("droplets", "Find droplets in images and measure them to sub-pixel accuracy");
  command->footer(
      "Example: invar measure droplets --image a.png --image b.png --camera result/camera.yaml --output "
      "droplets.csv\n"
      "Best droplets first within each image; status says ok, satellite, cut (by the border) or dust.");
  auto options = std::make_shared<MeasureDropletsOptions>();
  command->add_option("--image", options->images, "image of droplets; may be given several times")
      ->required()
      ->type_size(1)
      ->expected(-1);
  command->add_option("--camera", options->camera, "camera.yaml: adds positions and diameters in m");
  command
      ->add_option("--distance", options->distance,
                   "distance of the substrate straight below a pinhole camera [m]; not needed where "
                   "camera.yaml has its plane")
      ->check(CLI::PositiveNumber);
  command->add_option("--output", options->output, "table to write, .csv or .csv.gz")->required();
  command->add_option("--report", options->report, "page to write: annotated images, sizes (.html)");
  command->callback([options] { measure(*options); });
}

}  // namespace invar::tools
