#include "tests/unit/vision/scenes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace invar::vision::testing {

std::vector<Recipe> recipes() {
  std::vector<Recipe> all;
  all.push_back({.name = "clean", .cuts = 3, .noise = 1.5});
  all.push_back({.name = "uneven",
                 .spread = 0.03,
                 .pairs = 5,
                 .satellites = 10,
                 .cuts = 4,
                 .dust = 20,
                 .light = 0.5,
                 .noise = 2.5});
  all.push_back({.name = "touching",
                 .drops = 20,
                 .pairs = 10,
                 .triples = 4,
                 .satellites = 6,
                 .cuts = 3,
                 .dust = 10,
                 .light = 0.3,
                 .noise = 2.0});
  all.push_back(
      {.name = "elliptic", .pairs = 4, .satellites = 5, .axis_ratio = 0.85, .gradient = 0.1, .light = 0.3});
  all.push_back({.name = "small",
                 .radius_least = 6.0,
                 .radius_most = 12.0,
                 .drops = 150,
                 .pairs = 10,
                 .satellites = 0,
                 .cuts = 4,
                 .dust = 0,
                 .light = 0.3});
  all.push_back({.name = "large",
                 .radius_least = 60.0,
                 .radius_most = 90.0,
                 .drops = 14,
                 .pairs = 2,
                 .satellites = 6,
                 .cuts = 2,
                 .dust = 20,
                 .light = 0.4});
  all.push_back({.name = "hard",
                 .spread = 0.02,
                 .pairs = 5,
                 .satellites = 10,
                 .cuts = 5,
                 .dust = 30,
                 .scratches = 3,
                 .axis_ratio = 0.93,
                 .gradient = 0.25,
                 .light = 0.6,
                 .clutter = 3.0,
                 .contrast_least = 50.0,
                 .contrast_most = 90.0,
                 .blur_most = 1.8,
                 .noise = 3.0,
                 .distortion = 0.006,
                 .jpeg_quality = 80});
  all.push_back({.name = "glare",
                 .pairs = 3,
                 .satellites = 5,
                 .cuts = 2,
                 .dust = 10,
                 .gradient = 0.1,
                 .glare = 1.0,
                 .light = 0.3,
                 .contrast_most = 130.0});
  return all;
}

TestScene make_scene(const Recipe& recipe, std::uint64_t seed) {
  std::mt19937_64 random{seed};
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>{a, b}(random);
  };
  TestScene out;
  out.name = recipe.name + " " + std::to_string(seed);
  Scene& s = out.scene;
  s.width = recipe.width;
  s.height = recipe.height;
  s.seed = seed;
  const double contrast = between(recipe.contrast_least, recipe.contrast_most);
  const bool light_drops = between(0.0, 1.0) < 0.5;
  const double low = between(20.0, std::min(60.0, 240.0 - contrast));
  s.background = light_drops ? low : low + contrast;
  s.foreground = light_drops ? low + contrast : low;
  s.blur = between(recipe.blur_least, recipe.blur_most);
  s.noise = recipe.noise * between(0.7, 1.2);
  s.light_slope_x = recipe.light * between(-1.0, 1.0);
  s.light_slope_y = recipe.light * between(-1.0, 1.0);
  s.vignetting = 0.5 * recipe.light * between(0.0, 1.0);
  s.clutter = recipe.clutter;
  s.distortion = recipe.distortion * between(-1.0, 1.0);
  s.jpeg_quality = recipe.jpeg_quality;
  s.dust = recipe.dust;
  for (int i = 0; i < recipe.scratches; ++i) {
    const double x = between(0.0, s.width), y = between(0.0, s.height),
                 angle = between(0.0, 2.0 * std::numbers::pi), length = between(60.0, 300.0);
    s.scratches.push_back({x, y, x + length * std::cos(angle), y + length * std::sin(angle),
                           between(1.0, 3.0), between(0.15, 0.6)});
  }

  const double radius = between(recipe.radius_least, recipe.radius_most);
  std::normal_distribution<double> normal{0.0, 1.0};
  const auto draw_radius = [&] { return radius * (1.0 + recipe.spread * normal(random)); };
  struct Placed {
    double x, y, radius;
  };
  std::vector<Placed> placed;
  const auto fits = [&](double x, double y, double r, double gap) {
    return std::none_of(placed.begin(), placed.end(),
                        [&](const Placed& p) { return std::hypot(p.x - x, p.y - y) < p.radius + r + gap; });
  };
  const auto add = [&](double x, double y, double r, Kind kind, bool touching) {
    RenderedDisc disc{.x = x, .y = y, .radius = r};
    if (kind == Kind::drop) {
      disc.axis_ratio = between(recipe.axis_ratio, 1.0);
      disc.angle = between(0.0, std::numbers::pi);
      disc.gradient_x = recipe.gradient * between(-1.0, 1.0);
      disc.gradient_y = recipe.gradient * between(-1.0, 1.0);
      disc.glare = recipe.glare;
    }
    s.discs.push_back(disc);
    placed.push_back({x, y, r});
    const cv::Point2d at = seen_at(s, x, y);
    const double dx = at.x - 0.5 * (s.width - 1), dy = at.y - 0.5 * (s.height - 1);
    const double bend =
        4.0 * s.distortion * (dx * dx + dy * dy) / (std::pow(s.width, 2) + std::pow(s.height, 2));
    out.truth.push_back({at.x, at.y, r / std::sqrt((1.0 + bend) * (1.0 + 3.0 * bend)), kind, touching});
  };
  const double inset = 4.0;
  const auto place = [&](int count, const auto& attempt) {
    for (int i = 0; i < count; ++i)
      for (int tries = 0; tries < 300; ++tries)
        if (attempt()) break;
  };
  const auto inside = [&](double x, double y, double r) {
    return x > r + inset && y > r + inset && x < s.width - 1 - r - inset && y < s.height - 1 - r - inset;
  };
  place(recipe.triples, [&] {
    const double x = between(0, s.width), y = between(0, s.height), angle = between(0.0, 7.0);
    if (!inside(x, y, 3.2 * radius) || !fits(x, y, 3.2 * radius, 6.0)) return false;
    const double bend = between(1.2, 3.14);  // between the arms: from a bent chain to a straight one
    add(x, y, draw_radius(), Kind::drop, true);
    for (const double side : {0.0, bend}) {
      const double d = 2.0 * radius * between(0.92, 1.0);
      add(x + d * std::cos(angle + side), y + d * std::sin(angle + side), draw_radius(), Kind::drop, true);
    }
    return true;
  });
  place(recipe.pairs, [&] {
    const double x = between(0, s.width), y = between(0, s.height), angle = between(0.0, 7.0);
    const double half = radius * between(0.9, 1.0);
    if (!inside(x, y, half + 1.1 * radius) || !fits(x, y, 2.1 * radius, 6.0)) return false;
    add(x - half * std::cos(angle), y - half * std::sin(angle), draw_radius(), Kind::drop, true);
    add(x + half * std::cos(angle), y + half * std::sin(angle), draw_radius(), Kind::drop, true);
    return true;
  });
  place(recipe.cuts, [&] {
    const double r = draw_radius(), out_by = between(-0.7, 0.6) * r;  // centre beyond the border
    const bool upright = between(0, 1) < 0.5, far = between(0, 1) < 0.5;
    const double along = upright ? between(2 * r, s.height - 2 * r) : between(2 * r, s.width - 2 * r);
    const double across = far ? (upright ? s.width : s.height) - 1 + out_by : -out_by;
    const double x = upright ? across : along, y = upright ? along : across;
    if (!fits(x, y, r, 6.0)) return false;
    add(x, y, r, Kind::cut, false);
    return true;
  });
  place(recipe.drops, [&] {
    const double r = draw_radius(), x = between(0, s.width), y = between(0, s.height);
    if (!inside(x, y, r) || !fits(x, y, r, 4.0)) return false;
    add(x, y, r, Kind::drop, false);
    return true;
  });
  place(recipe.satellites, [&] {
    const double r = radius * between(0.1, 0.32), x = between(0, s.width), y = between(0, s.height);
    if (!inside(x, y, r) || !fits(x, y, r, 3.0)) return false;
    add(x, y, r, Kind::satellite, false);
    return true;
  });
  return out;
}

double Figures::centre_rms() const { return right > 0 ? std::sqrt(square / right) : 0.0; }

void Figures::add(const Figures& other) {
  drops += other.drops, found += other.found, right += other.right;
  free_drops += other.free_drops, free_right += other.free_right;
  square += other.square, radius += other.radius;
  faults.insert(faults.end(), other.faults.begin(), other.faults.end());
}

Figures judge(const TestScene& scene, const Droplets& measured) {
  Figures out;
  std::vector<bool> taken(measured.droplets.size(), false);
  const auto words = [&](const std::string& what, double x, double y, double r) {
    out.faults.push_back(scene.name + ": " + what + " at " + std::to_string(std::lround(x)) + ", " +
                         std::to_string(std::lround(y)) + " radius " + std::to_string(std::lround(r)));
  };
  for (const TrueDrop& drop : scene.truth) {
    if (drop.kind != Kind::drop) continue;
    ++out.drops;
    out.free_drops += !drop.touching;
    double nearest = 0.5 * drop.radius;
    std::size_t best = measured.droplets.size();
    for (std::size_t i = 0; i < measured.droplets.size(); ++i) {
      const Droplet& d = measured.droplets[i];
      const double away = std::hypot(d.x - drop.x, d.y - drop.y);
      if (!taken[i] && d.status == DropletStatus::ok && away < nearest) nearest = away, best = i;
    }
    if (best == measured.droplets.size()) {
      words(drop.touching ? "missed a touching drop" : "missed a drop", drop.x, drop.y, drop.radius);
      continue;
    }
    taken[best] = true;
    ++out.right;
    out.free_right += !drop.touching;
    out.square += nearest * nearest;
    out.radius += measured.droplets[best].radius - drop.radius;
    if (nearest > 0.3) words("centre off by " + std::to_string(nearest), drop.x, drop.y, drop.radius);
  }
  for (std::size_t i = 0; i < measured.droplets.size(); ++i) {
    const Droplet& d = measured.droplets[i];
    if (d.status != DropletStatus::ok) continue;
    ++out.found;
    if (!taken[i]) words("invented a drop", d.x, d.y, d.radius);
  }
  return out;
}

}  // namespace invar::vision::testing
