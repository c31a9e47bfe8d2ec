#include "components/vision/droplets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "components/vision/blobs.hpp"
#include "core/base/contract.hpp"

namespace invar::vision {

namespace {

struct Measured {
  Shape shape;
  OutlineFit fit;
  Rays rays;
  bool alive = true;
};

double median(std::vector<double> values, double otherwise) {
  if (values.empty()) return otherwise;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double circularity_of(const Measured& drop) {
  // The outline with what the smooth curve leaves of it, at the rays.
  const double radius = drop.shape.radius,
               wave = drop.shape.cos2 * drop.shape.cos2 + drop.shape.sin2 * drop.shape.sin2;
  // Of r = R + a cos 2t: area pi (R^2 + a^2/2); perimeter 2 pi R (1 + (2 a)^2/(4 R^2)) to second order. Roughness of
  // RMS q at a correlation length of three rays lengthens the perimeter likewise.
  const double length = 6.0 * std::numbers::pi * radius / drop.rays.count;
  const double rough = drop.fit.residual / std::max(1.0, length);
  const double perimeter =
      2.0 * std::numbers::pi * radius * (1.0 + wave / (radius * radius) + 0.5 * rough * rough);
  const double area = std::numbers::pi * (radius * radius + 0.5 * wave);
  return std::min(1.0, 4.0 * std::numbers::pi * area / (perimeter * perimeter));
}

// Each pair of drops whose outlines come nearer than `gap` along x, once.
template <class Visit>
void visit_neighbours(std::vector<Measured>& drops, double gap, const Visit& visit) {
  std::vector<std::pair<double, Measured*>> by_x;
  by_x.reserve(drops.size());
  double largest = 0.0;
  for (Measured& drop : drops) {
    by_x.emplace_back(drop.shape.x, &drop);
    largest = std::max(largest, drop.shape.radius);
  }
  std::sort(by_x.begin(), by_x.end());
  for (auto one = by_x.begin(); one != by_x.end(); ++one) {
    const Shape& a = one->second->shape;
    for (auto other = one + 1; other != by_x.end() && other->first - a.x < a.radius + largest + gap;
         ++other) {
      const Shape& b = other->second->shape;
      const double dx = a.x - b.x, dy = a.y - b.y, near = a.radius + b.radius + gap;
      if (dx * dx + dy * dy < near * near) visit(*one->second, *other->second);
    }
  }
}

double clarity(const Measured& drop) { return drop.fit.coverage * drop.shape.radius; }

// Of two fits of one drop the better stays.
void drop_doubles(std::vector<Measured>& drops) {
  std::vector<std::pair<Measured*, Measured*>> doubles;  // the better one, the worse one
  visit_neighbours(drops, 0.0, [&](Measured& one, Measured& other) {
    const Shape &a = one.shape, &b = other.shape;
    const double dx = a.x - b.x, dy = a.y - b.y, least = 0.6 * std::max(a.radius, b.radius);
    if (dx * dx + dy * dy >= least * least) return;
    if (clarity(one) >= clarity(other))
      doubles.emplace_back(&one, &other);
    else
      doubles.emplace_back(&other, &one);
  });
  if (doubles.empty()) return;
  std::sort(doubles.begin(), doubles.end(),
            [](const auto& a, const auto& b) { return clarity(*a.second) > clarity(*b.second); });
  for (const auto& [better, worse] : doubles)
    if (better->alive) worse->alive = false;
  std::erase_if(drops, [](const Measured& drop) { return !drop.alive; });
}

// The `most` drops whose outline was seen best.
std::vector<const Measured*> clearest(const std::vector<Measured>& drops, std::size_t most) {
  std::vector<const Measured*> order;
  for (const Measured& drop : drops) order.push_back(&drop);
  const auto end = order.begin() + static_cast<std::ptrdiff_t>(std::min(most, order.size()));
  std::partial_sort(order.begin(), end, order.end(),
                    [](const Measured* a, const Measured* b) { return clarity(*a) > clarity(*b); });
  order.erase(end, order.end());
  return order;
}

// What hides part of a drop's edge: its neighbours.
void close_rays(std::vector<Measured>& drops, double reach, double guard) {
  visit_neighbours(drops, reach + guard, [&](Measured& one, Measured& other) {
    const Shape &a = one.shape, &b = other.shape;
    one.rays.close(a, reach, b.x, b.y, b.radius, guard);
    other.rays.close(b, reach, a.x, a.y, a.radius, guard);
  });
}

double outside_share(const Shape& shape, const cv::Mat& image) {
  const double r = shape.radius;
  const double beyond = std::max({-0.5 - (shape.x - r), -0.5 - (shape.y - r),
                                  shape.x + r - (image.cols - 0.5), shape.y + r - (image.rows - 0.5)});
  return beyond / r;
}

// Edge filters of one blur, by their half widths, made when first wanted.
class Filters {
 public:
  explicit Filters(double blur) : blur_{blur} {}
  const EdgeFilter& at(double radius) {
    const int half = EdgeFilter::half_for(blur_, radius);
    auto& filter = made_[static_cast<std::size_t>(half)];
    if (!filter) filter.emplace(blur_, half);
    return *filter;
  }

 private:
  double blur_;
  std::array<std::optional<EdgeFilter>, EdgeFilter::most_half + 1> made_;
};

// Every candidate to a few tenths of a pixel. One that stands alone is known well enough to go straight to its edge
// with few rays; any other is sought.
std::vector<Measured> rough(const cv::Mat& image, const Detection& found, Filters& filters) {
  std::vector<Measured> drops;
  drops.reserve(found.candidates.size());
  for (const Candidate& candidate : found.candidates) {
    if (candidate.radius < 1.5) continue;
    Measured& drop = drops.emplace_back();
    const Shape start{candidate.x, candidate.y, candidate.radius, 0.0, 0.0};
    bool done = false;
    if (candidate.alone) {
      drop.rays.choose(0.25 * candidate.radius);
      drop.shape = start;
      for (int round = 0; round < 3 && !done; ++round) {
        drop.fit =
            refine_outline(image, drop.shape, found.polarity, filters.at(drop.shape.radius), drop.rays);
        if (!drop.fit.valid || drop.fit.support < 0.8) break;
        drop.shape = drop.fit.shape;
        done = drop.fit.moved < 0.8;
      }
      done = done && drop.fit.coverage > 0.8;
    }
    if (!done) {
      drop.shape = start;
      drop.rays.choose(std::max(10.0, 0.6 * candidate.radius));
      const double reach = std::clamp(0.25 * candidate.radius, 3.0, 8.0);
      drop.fit = seek_outline(image, drop.shape, found.polarity, reach, drop.rays);
      if (!drop.fit.valid || drop.fit.coverage < 0.2) {
        drops.pop_back();
        continue;
      }
      drop.shape = drop.fit.shape;
    }
  }
  return drops;
}

}  // namespace

std::string_view name(DropletStatus status) {
  switch (status) {
    case DropletStatus::ok:
      return "ok";
    case DropletStatus::satellite:
      return "satellite";
    case DropletStatus::cut:
      return "cut";
    case DropletStatus::dust:
      return "dust";
  }
  return "dust";
}

std::size_t Droplets::sound() const {
  return static_cast<std::size_t>(std::count_if(
      droplets.begin(), droplets.end(), [](const Droplet& d) { return d.status == DropletStatus::ok; }));
}

cv::Mat gray(const cv::Mat& image) {
  cv::Mat out = image;
  if (out.channels() == 3) cv::cvtColor(out, out, cv::COLOR_BGR2GRAY);
  if (out.channels() == 4) cv::cvtColor(out, out, cv::COLOR_BGRA2GRAY);
  if (out.depth() == CV_8U) return out;
  double least = 0.0, most = 0.0;
  cv::minMaxLoc(out, &least, &most);
  const double factor = most > least ? 255.0 / (most - least) : 1.0;
  cv::Mat scaled;
  out.convertTo(scaled, CV_8U, factor, -least * factor);
  return scaled;
}

Droplets measure_droplets(const cv::Mat& image, const MeasureOptions& options) {
  INVAR_EXPECTS(image.type() == CV_8UC1 && image.cols >= 16 && image.rows >= 16, image.type(), image.cols,
                image.rows);
  Droplets out;
  const Detection found = detect(image, {.polarity = options.polarity});
  out.polarity = found.polarity;
  out.contrast = found.contrast;
  if (!(found.contrast > 0.0)) return out;

  Filters filters{1.2};
  std::vector<Measured> drops = rough(image, found, filters);
  drop_doubles(drops);

  // The blur is the camera's: from the best drops, then for all.
  std::vector<double> blurs;
  for (const Measured& drop : drops)
    if (drop.fit.blur > 0.0 && drop.fit.support > 0.8) blurs.push_back(drop.fit.blur);
  double blur = std::clamp(median(blurs, 1.2), 0.4, 4.0);
  for (int round = 0; round < 2; ++round) {
    filters = Filters{blur};
    blurs.clear();
    for (const Measured* drop : clearest(drops, 5)) {
      Rays rays = drop->rays;
      const OutlineFit fit =
          refine_outline(image, drop->shape, found.polarity, filters.at(drop->shape.radius), rays);
      if (fit.valid) blurs.push_back(fit.blur);
    }
    const double before = blur;
    blur = std::clamp(median(blurs, blur), 0.4, 4.0);
    if (std::abs(blur - before) < 0.1 * blur) break;
  }
  filters = Filters{blur};
  out.blur = blur;

  // Where noise rules, more rays are worth their time; elsewhere the pixels are used up already.
  const double density = found.noise > 0.04 * found.contrast ? 0.8 : 0.6;
  for (Measured& drop : drops) drop.rays.choose(std::max(10.0, density * drop.shape.radius));
  close_rays(drops, 3.0 * blur + 3.0, 1.0 + 1.5 * blur);
  std::vector<double> contrasts;
  for (Measured& drop : drops) {
    drop.alive = false;
    for (int round = 0; round < 4; ++round) {
      drop.fit = refine_outline(image, drop.shape, found.polarity, filters.at(drop.shape.radius), drop.rays);
      if (!drop.fit.valid) break;
      drop.shape = drop.fit.shape;
      drop.alive = true;
      // A ray that was found foreign has spoilt the common slopes: once more without it.
      if (drop.fit.moved < 0.25 * blur && (round > 0 || drop.fit.support == 1.0)) break;
    }
    drop.alive = drop.alive && drop.fit.valid;
    if (drop.alive) contrasts.push_back(drop.fit.contrast);
  }
  std::erase_if(drops, [](const Measured& drop) { return !drop.alive; });
  drop_doubles(drops);
  const double contrast = median(contrasts, 0.0);

  std::vector<std::pair<double, double>> sizes;  // radius, area
  for (Measured& drop : drops) {
    // A blurred disc's edge lies inside the disc's by blur^2/(2 R): the curvature's pull.
    drop.shape.radius +=
        drop.fit.blur * drop.fit.blur / (2.0 * std::max(drop.shape.radius, 2.0 * drop.fit.blur));
    if (outside_share(drop.shape, image) < 0.1 && drop.fit.support > 0.7)
      sizes.emplace_back(drop.shape.radius, drop.shape.radius * drop.shape.radius);
  }
  std::sort(sizes.begin(), sizes.end());
  double total = 0.0, sum = 0.0;
  for (const auto& size : sizes) total += size.second;
  for (const auto& size : sizes) {
    out.radius = size.first;
    if ((sum += size.second) >= 0.5 * total) break;
  }

  for (const Measured& drop : drops) {
    Droplet d;
    d.x = drop.shape.x;
    d.y = drop.shape.y;
    d.radius = drop.shape.equal_area_radius();
    d.circularity = circularity_of(drop);
    d.sigma = drop.fit.sigma;
    d.outline = drop.shape;
    const double strength = std::min(1.0, drop.fit.contrast / std::max(1e-9, 0.6 * contrast));
    d.score =
        std::clamp(drop.fit.support * std::sqrt(drop.fit.coverage) * d.circularity * strength, 0.0, 1.0);
    const bool clean = drop.fit.support > 0.6 && drop.fit.coverage > 0.3 && strength > 0.4 &&
                       drop.fit.residual < 0.3 + 0.03 * d.radius && drop.shape.axis_ratio() > 0.6;
    if (!clean || d.radius > options.largest_radius) {
      d.status = DropletStatus::dust;
    } else if (outside_share(drop.shape, image) > 0.1) {
      d.status = DropletStatus::cut;
    } else if (d.radius < std::max(options.least_radius, 0.55 * out.radius)) {
      d.status = DropletStatus::satellite;
    }
    if (d.status == DropletStatus::dust && d.radius < 0.3 * out.radius) continue;
    out.droplets.push_back(d);
  }
  std::sort(out.droplets.begin(), out.droplets.end(), [](const Droplet& a, const Droplet& b) {
    return (a.status == DropletStatus::ok) != (b.status == DropletStatus::ok) ? a.status == DropletStatus::ok
                                                                              : a.score > b.score;
  });
  return out;
}

}  // namespace invar::vision
