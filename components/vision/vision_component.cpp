#include "components/vision/vision_component.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/component/cell_folders.hpp"
#include "core/vision/camera_file.hpp"
#include "core/vision/library.hpp"
#include "core/vision/ruler_file.hpp"

namespace invar::vision {

namespace {

constexpr int most_attempts = 3;
constexpr std::size_t most_droplets = 1024;  // the bound of DropletsMeasured.droplets

image::DropletStatus wire_status(DropletStatus status) {
  switch (status) {
    case DropletStatus::ok:
      return image::DROPLET_SOUND;
    case DropletStatus::satellite:
      return image::DROPLET_SATELLITE;
    case DropletStatus::cut:
      return image::DROPLET_CUT;
    case DropletStatus::dust:
      return image::DROPLET_DUST;
  }
  return image::DROPLET_DUST;
}

Eigen::Vector2d stage_at(const image::Frame& frame) { return {frame.position()[0], frame.position()[1]}; }

/// The frame's pixels in place; they live as long as the frame. Nothing where its numbers contradict one another.
std::optional<PixelsView> pixels_of(const image::Frame& frame) {
  const bool wide = frame.format() == image::PIXEL_MONO16;
  const std::size_t wanted = std::size_t{frame.width()} * frame.height() * (wide ? 2U : 1U);
  if (frame.width() < 16 || frame.height() < 16 || frame.pixels().size() != wanted) return {};
  return PixelsView{static_cast<int>(frame.width()), static_cast<int>(frame.height()), wide,
                    frame.pixels().data()};
}

}  // namespace

Vision::Vision(const Parameters& parameters) : parameters_{parameters} {
  if (parameters.polarity != "auto" && parameters.polarity != "light" && parameters.polarity != "dark")
    throw InputError{"polarity", "is `" + parameters.polarity + "`", "write light, dark or auto"};
  polarity_ = parameters.polarity == "light" ? +1 : parameters.polarity == "dark" ? -1 : 0;
  if (parameters.camera.empty() && parameters.ruler.empty())
    throw InputError{"camera", "missing, and no `ruler` to calibrate by", "name camera.yaml or ruler.yaml"};
  if (!parameters.ruler.empty()) radii_ = radii_of(read_ruler(parameters.ruler));
  if (!parameters.camera.empty()) camera_ = read_camera(parameters.camera, parameters.distance);
}

void Vision::configure() {
  (void)library();
  camera_.reset();
  if (!parameters_.camera.empty()) camera_ = read_camera(parameters_.camera, parameters_.distance);
}

void Vision::activate() {
  running_.reset();
  sample_ = {};
  last_number_ = 0;
  show_view(camera_ ? camera_->width : 0, camera_ ? camera_->height : 0);
  reported_ = false;
}

void Vision::deactivate() noexcept {
  if (running_) report(job::JOB_CANCELLED, "the component was deactivated");
  running_.reset();
}

void Vision::show_view(int width, int height) {
  sample_.view_center() = {parameters_.mount.offset.x(), parameters_.mount.offset.y()};
  if (!camera_ || width <= 0 || height <= 0) return;
  const Eigen::Vector2d size =
      camera_->to_metres({width - 0.5, height - 0.5}) - camera_->to_metres({-0.5, -0.5});
  const double c = std::abs(std::cos(parameters_.mount.rotation)),
               s = std::abs(std::sin(parameters_.mount.rotation));
  sample_.view_size() = {c * size.x() - s * size.y(), c * size.y() - s * size.x()};
}

void Vision::report(job::JobPhase phase, const std::string& text) {
  reported_ = true;
  stamp(sample_);
  sample_.component_id(id);
  sample_.phase(phase);
  sample_.text(text.substr(0, 511));
  sample_.scale(camera_ ? camera_->scale : 0.0);
  sample_.scale_sigma(camera_ ? camera_->scale_sigma : 0.0);
  status_.write(sample_);
}

void Vision::start(const image::VisionCommand& command) {
  if (command.id() == sample_.id() && sample_.id() != 0) return;  // the same request again
  if (running_) {
    report(job::JOB_RUNNING, "request " + std::to_string(sample_.id()) + " is not done yet; ask again later");
    return;
  }
  sample_.id(command.id());
  picture_.reset();
  if (command.picture_path().size() > 0) {
    picture_ = command.picture_path().c_str();
    if (folders) picture_ = folders->picture(*picture_);
    if (!picture_) return report(job::JOB_FAILED, std::string{CellFolders::no_picture});
  }
  if (command.wanted() == image::VISION_MEASURE && !camera_)
    return report(job::JOB_FAILED,
                  "the camera is not calibrated: show it the ruler and ask for a calibration");
  if (command.wanted() == image::VISION_CALIBRATE && radii_.empty())
    return report(job::JOB_FAILED, "no `ruler` is known: name ruler.yaml in the cell file");
  running_ = command;
  attempts_ = 0;
  report(job::JOB_RUNNING, "waits for a frame");
  ask();
}

void Vision::ask() {
  image::ExposeCommand command;
  stamp(command);
  command.component_id(id);
  command.id(running_->id());
  expose_.write(command);
  asked_ = now();
  ++attempts_;
}

Duration Vision::since(const image::Frame& frame) const {
  return (simulated_time ? now() : utc_now()) - Instant{frame.at().time_ns()};
}

Eigen::Vector2d Vision::middle(const PixelsView& picture) const {
  return camera_->to_metres({0.5 * (picture.width - 1), 0.5 * (picture.height - 1)});
}

void Vision::step(const Tick&) noexcept {
  try {
    // Not in `activate`: what is written before the first step reaches nobody in simulated time.
    if (!reported_) report(job::JOB_IDLE, camera_ ? "ready" : "not calibrated");
    image::VisionCommand command;
    while (command_.take(command)) start(command);
    if (const std::uint64_t received = frame_.received(); received != taken_) {
      taken_ = received;
      if (const auto* frame = frame_.latest()) take(*frame);
    }
    if (!running_ || now() - asked_ < Duration::seconds(parameters_.patience)) return;
    if (attempts_ < most_attempts) return ask();
    running_.reset();
    report(job::JOB_FAILED, "no frame came in " + std::to_string(most_attempts) +
                                " attempts: is the camera active and connected?");
  } catch (const std::exception& error) {
    running_.reset();
    report(job::JOB_FAILED, error.what());
  }
}

void Vision::take(const image::Frame& frame) {
  if (frame.number() == last_number_) return;
  sample_.frames_received(sample_.frames_received() + 1);
  if (last_number_ != 0 && frame.number() > last_number_ + 1)
    sample_.frames_dropped(sample_.frames_dropped() + frame.number() - last_number_ - 1);
  last_number_ = frame.number();
  const auto seen = pixels_of(frame);
  if (!seen) throw std::runtime_error{"a frame whose size does not fit its pixels"};
  const PixelsView& picture = *seen;
  const bool asked = running_ && frame.request() == running_->id();
  if (asked && running_->wanted() == image::VISION_CALIBRATE) {
    calibrate(picture);
    show_view(picture.width, picture.height);
    running_.reset();
    report(job::JOB_DONE, "calibrated");
  } else if (camera_) {
    if (camera_->width > 0 && (camera_->width != picture.width || camera_->height != picture.height))
      throw std::runtime_error{"frames of " + std::to_string(picture.width) + " x " +
                               std::to_string(picture.height) + " px, but the camera was calibrated with " +
                               std::to_string(camera_->width) + " x " + std::to_string(camera_->height) +
                               ": calibrate again"};
    show_view(picture.width, picture.height);
    measure(frame, picture, asked);
    if (asked) {
      running_.reset();
      report(job::JOB_DONE, "measured");
    } else if (!running_) {
      report(sample_.phase(), sample_.text().c_str());
    }
  }
}

void Vision::calibrate(const PixelsView& picture) {
  RulerFailure failure;
  const auto fit = library().calibrate(picture, radii_, failure);
  if (!fit) throw std::runtime_error{"the image " + failure.what};
  if (wants_picture()) {
    std::vector<AnnotatedOutline> outlines;
    for (const RulerCircle& circle : fit->circles) outlines.push_back({circle.outline, Colour::green, ""});
    write_picture(library().draw_outlines(picture, outlines));
  }
  const std::filesystem::path folder = parameters_.out;
  make_folder(folder);
  std::ofstream out = new_stream(folder / "camera.yaml");
  out << camera_yaml(fit->camera);
  out.close();
  if (!out) throw std::runtime_error{(folder / "camera.yaml").string() + " cannot be written"};
  camera_ = fit->camera;
}

void Vision::measure(const image::Frame& frame, const PixelsView& picture, bool asked) {
  MeasureOptions options{.polarity = polarity_};
  options.least_radius = 0.5 * parameters_.least_diameter / camera_->scale;
  if (parameters_.largest_diameter > 0.0)
    options.largest_radius = 0.5 * parameters_.largest_diameter / camera_->scale;
  const Droplets found = library().measure(picture, options);
  publish(frame, found, asked ? running_->id() : 0);
  if (!asked || !wants_picture()) return;
  std::vector<AnnotatedTarget> targets;
  for (const auto& target : running_->targets()) {
    const auto seen = camera_->to_pixels(
        middle(picture) +
        parameters_.mount.from_machine({target.position()[0], target.position()[1]}, stage_at(frame)));
    if (seen) targets.push_back({seen->x(), seen->y(), seen->x(), seen->y()});
  }
  point_at_nearest(targets, found, 2.0 * found.radius);
  write_picture(library().draw_droplets(picture, found, targets));
}

void Vision::publish(const image::Frame& frame, const Droplets& found, std::uint64_t request) {
  const Eigen::Vector2d center =
      camera_->to_metres({0.5 * (frame.width() - 1.0), 0.5 * (frame.height() - 1.0)});
  const double scale_share = camera_->scale_sigma / camera_->scale;
  measured_.cell(cell);
  measured_.component_id(id);
  measured_.at(frame.at());
  measured_.frame_number(frame.number());
  measured_.request(request);
  measured_.position(frame.position());
  measured_.droplets().clear();
  for (const Droplet& drop : found.droplets) {
    if (measured_.droplets().size() == most_droplets) break;  // the best come first
    const Eigen::Vector2d away = camera_->to_metres({drop.x, drop.y}) - center;
    const Eigen::Vector2d at = parameters_.mount.to_machine(away, stage_at(frame));
    const double scale = camera_->local_scale({drop.x, drop.y}), diameter = 2.0 * drop.radius * scale;
    image::MeasuredDroplet out;
    out.status(wire_status(drop.status));
    out.position({at.x(), at.y()});
    out.position_sigma(std::hypot(drop.sigma * scale, scale_share * away.norm()));
    out.diameter(diameter);
    // A circle's radius is known sqrt(2) times better than a coordinate of its centre.
    out.diameter_sigma(std::hypot(std::sqrt(2.0) * drop.sigma * scale, scale_share * diameter));
    out.circularity(drop.circularity);
    out.score(drop.score);
    out.pixel({drop.x, drop.y});
    measured_.droplets().push_back(out);
  }
  const Duration latency = since(frame);
  measured_.latency_ns(latency.ns);
  sample_.latency_ns(latency.ns);
  sample_.frames_measured(sample_.frames_measured() + 1);
  droplets_.write(measured_);
}

bool Vision::wants_picture() const { return running_ && picture_; }

void Vision::write_picture(const std::vector<unsigned char>& png) const {
  const std::filesystem::path file = *picture_;
  if (file.has_parent_path()) make_folder(file.parent_path());
  std::ofstream out = new_stream(file);
  out.write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  out.close();
  if (!out) throw std::runtime_error{file.string() + " cannot be written"};
}

}  // namespace invar::vision
