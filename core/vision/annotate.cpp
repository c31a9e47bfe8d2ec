#include "core/vision/annotate.hpp"

#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace invar::vision {

namespace {

constexpr int shift = 4;  // OpenCV draws in 1/16 px

cv::Point fixed(double x, double y) {
  return {static_cast<int>(std::lround(x * (1 << shift))), static_cast<int>(std::lround(y * (1 << shift)))};
}

cv::Scalar bgr(Colour colour) {
  switch (colour) {
    case Colour::green:
      return {60, 190, 40};
    case Colour::amber:
      return {0, 160, 255};
    case Colour::red:
      return {40, 40, 230};
    case Colour::blue:
      return {230, 140, 30};
  }
  return {};
}

Colour colour_of(DropletStatus status) {
  switch (status) {
    case DropletStatus::ok:
      return Colour::green;
    case DropletStatus::cut:
      return Colour::amber;
    case DropletStatus::satellite:
      return Colour::blue;
    case DropletStatus::dust:
      return Colour::red;
  }
  return Colour::red;
}

}  // namespace

cv::Mat annotate(const cv::Mat& image, const std::vector<AnnotatedOutline>& outlines,
                 const std::vector<AnnotatedTarget>& targets) {
  cv::Mat out;
  cv::cvtColor(image, out, cv::COLOR_GRAY2BGR);
  for (const AnnotatedOutline& entry : outlines) {
    std::vector<cv::Point> line;
    constexpr int points = 120;
    for (int i = 0; i < points; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / points;
      const Shape& s = entry.outline;
      const double r = s.radius + s.cos2 * std::cos(2.0 * angle) + s.sin2 * std::sin(2.0 * angle);
      line.push_back(fixed(s.x + r * std::cos(angle), s.y + r * std::sin(angle)));
    }
    cv::polylines(out, line, true, bgr(entry.colour), 1, cv::LINE_AA, shift);
    const cv::Point center = fixed(entry.outline.x, entry.outline.y);
    const int arm = 3 << shift;
    cv::line(out, center - cv::Point(arm, 0), center + cv::Point(arm, 0), bgr(entry.colour), 1, cv::LINE_AA,
             shift);
    cv::line(out, center - cv::Point(0, arm), center + cv::Point(0, arm), bgr(entry.colour), 1, cv::LINE_AA,
             shift);
    if (!entry.label.empty())
      cv::putText(out, entry.label,
                  cv::Point(static_cast<int>(entry.outline.x) + 5, static_cast<int>(entry.outline.y) - 5),
                  cv::FONT_HERSHEY_SIMPLEX, 0.4, bgr(entry.colour), 1, cv::LINE_AA);
  }
  for (const AnnotatedTarget& t : targets) {
    cv::circle(out, fixed(t.x, t.y), 4 << shift, bgr(Colour::red), 1, cv::LINE_AA, shift);
    const cv::Point end = fixed(t.x + t.exaggeration * (t.to_x - t.x), t.y + t.exaggeration * (t.to_y - t.y));
    cv::arrowedLine(out, fixed(t.x, t.y), end, bgr(Colour::red), 1, cv::LINE_AA, shift, 0.15);
  }
  return out;
}

cv::Mat annotate(const cv::Mat& image, const Droplets& droplets,
                 const std::vector<AnnotatedTarget>& targets) {
  std::vector<AnnotatedOutline> outlines;
  for (const Droplet& drop : droplets.droplets)
    outlines.push_back({drop.outline, colour_of(drop.status),
                        drop.status == DropletStatus::ok ? "" : std::string{name(drop.status)}});
  return annotate(image, outlines, targets);
}

std::vector<unsigned char> encode_png(const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes);
  return bytes;
}

}  // namespace invar::vision
