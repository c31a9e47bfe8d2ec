// Droplets in a 1200 x 800 image, one thread: ours beside OpenCV's Hough circles and threshold + contour + algebraic fit.
// Counters: images/s, RMS error of the centre [px], bias of the radius [px], recall, precision on the same picture.
#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/metrology/camera/circle_fit.hpp"
#include "core/vision/droplets.hpp"
#include "tests/unit/vision/scenes.hpp"

namespace {

using namespace invar::vision;

struct Case {
  testing::TestScene scene;
  cv::Mat image;
  bool light;
};

const Case& make_case(int which) {
  static const auto cases = [] {
    std::vector<Case> all;
    for (const auto& recipe : testing::recipes()) {
      const auto scene = testing::make_scene(recipe, 1);
      all.push_back({scene, render(scene.scene), scene.scene.foreground > scene.scene.background});
    }
    return all;
  }();
  return cases[static_cast<std::size_t>(which)];
}

void tell(benchmark::State& state, const Case& c, const Droplets& found) {
  const auto figures = testing::judge(c.scene, found);
  state.SetLabel(c.scene.name);
  state.counters["images/s"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["centre_px"] = figures.centre_rms();
  state.counters["radius_px"] = figures.radius_bias();
  state.counters["recall"] = figures.recall();
  state.counters["precision"] = figures.precision();
}

void ours(benchmark::State& state) {
  cv::setNumThreads(1);
  const Case& c = make_case(static_cast<int>(state.range(0)));
  Droplets found;
  for (auto _ : state) found = measure_droplets(c.image);
  tell(state, c, found);
}

// The rivals are told the polarity and the true radius, which ours finds out.
double true_radius(const Case& c) {
  double sum = 0.0;
  int n = 0;
  for (const auto& drop : c.scene.truth)
    if (drop.kind == testing::Kind::drop) sum += drop.radius, ++n;
  return sum / n;
}

void hough_circles(benchmark::State& state) {
  cv::setNumThreads(1);
  const Case& c = make_case(static_cast<int>(state.range(0)));
  const double radius = true_radius(c);
  std::vector<cv::Vec3f> circles;
  for (auto _ : state) {
    cv::Mat smooth;
    cv::medianBlur(c.image, smooth, 5);
    cv::HoughCircles(smooth, circles, cv::HOUGH_GRADIENT, 1.0, 1.5 * radius, 80.0, 15.0,
                     static_cast<int>(0.8 * radius), static_cast<int>(1.2 * radius));
  }
  Droplets found;
  for (const auto& circle : circles) {
    Droplet drop;
    drop.x = static_cast<double>(circle[0]), drop.y = static_cast<double>(circle[1]),
    drop.radius = static_cast<double>(circle[2]);
    found.droplets.push_back(drop);
  }
  tell(state, c, found);
}

void threshold_contour_kasa(benchmark::State& state) {
  cv::setNumThreads(1);
  const Case& c = make_case(static_cast<int>(state.range(0)));
  const double radius = true_radius(c);
  Droplets found;
  for (auto _ : state) {
    found.droplets.clear();
    cv::Mat smooth, mask;
    cv::GaussianBlur(c.image, smooth, {5, 5}, 0.0);
    cv::threshold(smooth, mask, 0.0, 255.0,
                  cv::THRESH_OTSU | (c.light ? cv::THRESH_BINARY : cv::THRESH_BINARY_INV));
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    for (const auto& contour : contours) {
      if (static_cast<double>(contour.size()) < 3.0 * radius) continue;
      Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(contour.size()));
      for (std::size_t i = 0; i < contour.size(); ++i)
        points.col(static_cast<Eigen::Index>(i)) << contour[i].x, contour[i].y;
      const auto circle = invar::metrology::kasa_circle(points);
      if (!circle) continue;
      Droplet drop;
      drop.x = circle->center.x(), drop.y = circle->center.y(), drop.radius = circle->radius;
      found.droplets.push_back(drop);
    }
  }
  tell(state, c, found);
}

BENCHMARK(ours)->DenseRange(0, 7)->Unit(benchmark::kMillisecond);
BENCHMARK(hough_circles)->DenseRange(0, 7)->Unit(benchmark::kMillisecond);
BENCHMARK(threshold_contour_kasa)->DenseRange(0, 7)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
