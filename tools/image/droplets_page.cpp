#include "tools/image/droplets_page.hpp"

#include <algorithm>
#include <cmath>

#include "core/vision/library.hpp"

namespace invar::tools {

namespace {

using report::number;

struct Sizes {
  std::vector<double> values;
  [[nodiscard]] double mean() const {
    double sum = 0.0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
  }
  [[nodiscard]] double deviation() const {
    double sum = 0.0;
    for (const double v : values) sum += (v - mean()) * (v - mean());
    return values.size() > 1 ? std::sqrt(sum / static_cast<double>(values.size() - 1)) : 0.0;
  }
};

std::size_t count(const vision::Droplets& droplets, vision::DropletStatus status) {
  return static_cast<std::size_t>(
      std::count_if(droplets.droplets.begin(), droplets.droplets.end(),
                    [&](const vision::Droplet& d) { return d.status == status; }));
}

}  // namespace

void add_droplets(report::Page& page, const std::vector<MeasuredImage>& images,
                  const std::optional<vision::CameraModel>& camera) {
  const std::string unit = camera ? "um" : "px";
  Sizes all;
  std::vector<std::vector<std::string>> rows;
  for (const MeasuredImage& image : images) {
    Sizes sizes;
    double sigma = 0.0;
    for (const vision::Droplet& d : image.droplets.droplets) {
      if (d.status != vision::DropletStatus::ok) continue;
      sizes.values.push_back(2.0 * d.radius * (camera ? 1e6 * camera->local_scale({d.x, d.y}) : 1.0));
      sigma += d.sigma;
    }
    all.values.insert(all.values.end(), sizes.values.begin(), sizes.values.end());
    const auto n = static_cast<double>(sizes.values.size());
    rows.push_back({image.name, number(n),
                    number(static_cast<double>(count(image.droplets, vision::DropletStatus::satellite))),
                    number(static_cast<double>(count(image.droplets, vision::DropletStatus::cut))),
                    number(n > 0 ? sizes.mean() : std::nan(""), 5),
                    number(n > 1 ? sizes.deviation() : std::nan(""), 3),
                    number(n > 0 ? sigma / n : std::nan(""), 2), number(image.droplets.blur, 2),
                    number(image.droplets.contrast, 3)});
  }
  page.table(
      {"image", "droplets", "satellites", "cut", "mean diameter [" + unit + "]",
       "standard deviation [" + unit + "]", "sigma of a centre [px]", "blur [px]", "contrast [grey levels]"},
      rows);
  for (const MeasuredImage& image : images)
    page.image(vision::library().draw_droplets(image.image.view(), image.droplets, {}), "image/png",
               image.name + ": sound droplets green, satellites blue, cut ones amber, dust red");
  if (all.values.size() < 5) return;
  std::sort(all.values.begin(), all.values.end());
  report::Series measured{"measured", report::Series::Style::steps, {}, {}, {}, {}, ""};
  report::Series normal{"normal", report::Series::Style::line, {}, {}, {}, {}, ""};
  const double mean = all.mean(), deviation = std::max(all.deviation(), 1e-12);
  for (std::size_t i = 0; i < all.values.size(); ++i) {
    measured.x.push_back(all.values[i]);
    measured.y.push_back((static_cast<double>(i) + 0.5) / static_cast<double>(all.values.size()));
  }
  for (int i = -30; i <= 30; ++i) {
    normal.x.push_back(mean + 0.1 * i * deviation);
    normal.y.push_back(0.5 * std::erfc(-0.1 * i / std::sqrt(2.0)));
  }
  page.plot({.title = "Diameters: share below",
             .x_label = "diameter [" + unit + "]",
             .y_label = "share",
             .series = {measured, normal},
             .x_range = {},
             .y_range = {}},
            "Mean " + number(mean, 5) + " " + unit + ", standard deviation " + number(deviation, 3) + " " +
                unit + ", " + number(static_cast<double>(all.values.size())) + " droplets");
}

}  // namespace invar::tools
