#include "core/vision/droplets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <span>

#include "core/base/contract.hpp"
#include "core/vision/blobs.hpp"

namespace invar::vision {

namespace {

struct Measured {
  Shape shape;
  OutlineFit fit;
  int rays = 0;             // that the fit was made with
  bool alone = false;       // its blob held nothing else: the edge is near
  bool approached = false;  // and was found by few rays
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
  const double length = 6.0 * std::numbers::pi * radius / drop.rays;
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

// Of these the `most` drops whose outline was seen best.
void keep_clearest(std::vector<Measured*>& drops, std::size_t most) {
  const auto end = drops.begin() + static_cast<std::ptrdiff_t>(std::min(most, drops.size()));
  std::partial_sort(drops.begin(), end, drops.end(),
                    [](const Measured* a, const Measured* b) { return clarity(*a) > clarity(*b); });
  drops.erase(end, drops.end());
}

// What hides part of a drop's edge: its neighbours, as they were found roughly.
struct Neighbour {
  const Measured* of;
  Shape shape;
};
std::vector<Neighbour> neighbours_of(std::vector<Measured>& drops, double gap) {
  std::vector<Neighbour> all;
  visit_neighbours(drops, gap, [&](Measured& one, Measured& other) {
    all.push_back({&one, other.shape});
    all.push_back({&other, one.shape});
  });
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.of < b.of; });
  return all;
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

constexpr double moved_enough = 0.8;  // px; from where a fit begins to find its edge

// The edge of a drop that stands alone, from near it, by few rays; false where it is not there.
bool approach(const cv::Mat& image, int polarity, Filters& filters, Rays& rays, Measured& drop) {
  rays.choose(0.25 * drop.shape.radius);
  for (int round = 0; round < 3; ++round) {
    drop.fit = refine_outline(image, drop.shape, polarity, filters.at(drop.shape.radius), rays);
    if (!drop.fit.valid || drop.fit.support < 0.8) return false;
    drop.shape = drop.fit.shape;
    if (drop.fit.moved < moved_enough) return drop.fit.coverage > 0.8;
  }
  return false;
}

// The edge of any drop, from some pixels away, to a few tenths of a pixel; false where it is not there.
bool seek(const cv::Mat& image, int polarity, Rays& rays, Measured& drop) {
  drop.alone = false;
  rays.choose(std::max(10.0, 0.6 * drop.shape.radius));
  const double reach = std::clamp(0.25 * drop.shape.radius, 3.0, 8.0);
  drop.fit = seek_outline(image, drop.shape, polarity, reach, rays);
  if (!drop.fit.valid || drop.fit.coverage < 0.2) return false;
  drop.shape = drop.fit.shape;
  return true;
}

// Every candidate to a few tenths of a pixel: one that stands alone is known as well from its blob, any other is sought.
std::vector<Measured> rough(const cv::Mat& image, const Detection& found, Rays& rays) {
  std::vector<Measured> drops;
  drops.reserve(found.candidates.size());
  for (const Candidate& candidate : found.candidates) {
    if (candidate.radius < 1.5) continue;
    Measured& drop = drops.emplace_back();
    drop.shape = {candidate.x, candidate.y, candidate.radius, 0.0, 0.0};
    drop.alone = candidate.alone;
    drop.fit.coverage = 1.0;
    if (!candidate.alone && !seek(image, found.polarity, rays, drop)) drops.pop_back();
  }
  return drops;
}

// The blur is the camera's: from some drops that stand alone, then from the best of these and of those that were sought.
double blur_of(const cv::Mat& image, int polarity, std::vector<Measured>& drops, Rays& rays) {
  constexpr std::size_t some = 24;
  Filters filters{1.2};
  std::vector<Measured*> alone, seen;
  for (Measured& drop : drops) (drop.alone ? alone : seen).push_back(&drop);
  std::vector<double> blurs;
  for (std::size_t k = 0, count = std::min(some, alone.size()); k < count; ++k) {
    Measured& drop = *alone[k * alone.size() / count];
    const Shape start = drop.shape;
    drop.approached = approach(image, polarity, filters, rays, drop);
    if (drop.approached) {
      seen.push_back(&drop);
      if (drop.fit.blur > 0.0) blurs.push_back(drop.fit.blur);
    } else {
      drop.shape = start;
    }
  }
  keep_clearest(seen, 5);
  double blur = std::clamp(median(blurs, 1.2), 0.4, 4.0);
  for (int round = 0; round < 2; ++round) {
    filters = Filters{blur};
    blurs.clear();
    for (const Measured* drop : seen) {
      rays.choose(std::max(10.0, 0.25 * drop->shape.radius));
      const OutlineFit fit =
          refine_outline(image, drop->shape, polarity, filters.at(drop->shape.radius), rays);
      if (fit.valid) blurs.push_back(fit.blur);
    }
    const double before = blur;
    blur = std::clamp(median(blurs, blur), 0.4, 4.0);
    if (std::abs(blur - before) < 0.1 * blur) break;
  }
  return blur;
}

// Fits a drop's outline until it stands; false where there is none. `neighbours`: of this drop alone.
bool measure(const cv::Mat& image, int polarity, Filters& filters, double blur, double density,
             std::span<const Neighbour> neighbours, Rays& rays, Measured& drop) {
  const Shape start = drop.shape;
  if (drop.alone && !drop.approached && !approach(image, polarity, filters, rays, drop)) {
    drop.shape = start;
    if (!seek(image, polarity, rays, drop)) return false;
  }
  rays.choose(std::max(10.0, density * drop.shape.radius));
  for (const Neighbour& next : neighbours)
    rays.close(drop.shape, 3.0 * blur + 3.0, next.shape.x, next.shape.y, next.shape.radius, 1.0 + 1.5 * blur);
  drop.rays = rays.count;
  bool alive = false;
  for (int round = 0; round < 4; ++round) {
    drop.fit = refine_outline(image, drop.shape, polarity, filters.at(drop.shape.radius), rays);
    if (!drop.fit.valid) return false;
    drop.shape = drop.fit.shape;
    alive = true;
    // A ray that was found foreign has spoilt the common slopes: once more without it.
    if (drop.fit.moved < 0.25 * blur && (round > 0 || drop.fit.support == 1.0)) break;
  }
  return alive;
}

}  // namespace

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

  Rays rays;
  std::vector<Measured> drops = rough(image, found, rays);
  drop_doubles(drops);
  const double blur = blur_of(image, found.polarity, drops, rays);
  Filters filters{blur};
  out.blur = blur;

  // Where noise rules, more rays are worth their time; elsewhere the pixels are used up already.
  const double density = found.noise > 0.04 * found.contrast ? 0.8 : 0.6;
  const auto neighbours = neighbours_of(drops, 4.0 + 4.5 * blur);
  auto next = neighbours.begin();
  std::vector<double> contrasts;
  for (Measured& drop : drops) {
    const auto first = next;
    while (next != neighbours.end() && next->of == &drop) ++next;
    drop.alive = measure(image, found.polarity, filters, blur, density, {first, next}, rays, drop);
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
