// Random pictures of droplets with known truth, from clean to nasty, and what a measurement of them is worth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/vision/droplets.hpp"
#include "core/vision/render.hpp"

namespace invar::vision::testing {

enum class Kind { drop, satellite, cut };

struct TrueDrop {
  double x, y, radius;  // px, as seen
  Kind kind;
  bool touching;
};

struct TestScene {
  std::string name;
  Scene scene;
  std::vector<TrueDrop> truth;
};

/// What makes a scene; every number is drawn anew for each seed, within what the recipe allows.
struct Recipe {
  std::string name;
  double radius_least = 18.0, radius_most = 34.0;  // px, the typical radius of a scene
  double spread = 0.015;                           // relative standard deviation of the radii
  int drops = 45;
  int pairs = 0;
  int triples = 0;
  int satellites = 0;
  int cuts = 0;
  int dust = 0;
  int scratches = 0;
  double axis_ratio = 1.0;  // smallest
  double gradient = 0.0;    // largest, share of the contrast per radius
  double glare = 0.0;
  double light = 0.0;  // largest slope and vignetting
  double clutter = 0.0;
  double contrast_least = 120.0, contrast_most = 190.0;  // grey levels
  double blur_least = 0.8, blur_most = 1.4;
  double noise = 2.0;
  double distortion = 0.0;
  int jpeg_quality = 0;
  int width = 1200, height = 800;
};

/// The recipes, easiest first: "clean", "uneven", "hard", ...
std::vector<Recipe> recipes();
TestScene make_scene(const Recipe& recipe, std::uint64_t seed);

struct Figures {
  int drops = 0, found = 0, right = 0;  // drops that do not touch and those that do
  int free_drops = 0, free_right = 0;   // of them, drops that touch nothing
  double square = 0.0;                  // px^2, sum over the right ones of the centre's error
  double radius = 0.0;                  // px, sum of the radius errors
  std::vector<std::string> faults;      // what was missed or invented, in words

  [[nodiscard]] double recall() const { return drops > 0 ? right / static_cast<double>(drops) : 1.0; }
  [[nodiscard]] double free_recall() const {
    return free_drops > 0 ? free_right / static_cast<double>(free_drops) : 1.0;
  }
  [[nodiscard]] double precision() const { return found > 0 ? right / static_cast<double>(found) : 1.0; }
  [[nodiscard]] double centre_rms() const;
  [[nodiscard]] double radius_bias() const { return right > 0 ? radius / right : 0.0; }
  void add(const Figures& other);
};

/// Pairs sound droplets with true whole drops within half a radius.
Figures judge(const TestScene& scene, const Droplets& measured);

}  // namespace invar::vision::testing
