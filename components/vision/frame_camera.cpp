#include "components/vision/frame_camera.hpp"

#include <algorithm>
#include <exception>
#include <stdexcept>

namespace invar::vision {

namespace {

constexpr std::size_t most_pixels = 2097152;  // bytes; the bound of Frame.pixels
constexpr std::size_t remembered = 256;       // positions of the stage

}  // namespace

FrameCamera::FrameCamera(const CameraParameters& parameters) : parameters_{parameters} {
  for (std::int64_t i = 0; i < parameters.axes; ++i)
    axes_.push_back(std::make_unique<Input<stage::AxisState>>(
        *this, std::string{"state_"} + "xyz" [i], InputOptions { .optional = true }));
}

void FrameCamera::activate() {
  free_running_ = false;
  request_ = 0;
  history_.clear();
}

void FrameCamera::follow_stage(const Tick& tick) {
  // One time for all axes: theirs are those of one cycle where one loop runs them.
  Position position{};
  Instant at = tick.now;
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (const auto* state = axes_[i]->latest()) {
      position[i] = state->position() - state->correction();
      at = {state->at().time_ns()};
    }
  if (!history_.empty() && history_.back().first >= at) return;
  history_.emplace_back(at, position);
  if (history_.size() > remembered) history_.pop_front();
}

FrameCamera::Position FrameCamera::position_at(Instant time) const {
  if (history_.empty()) return {};
  const auto after = std::lower_bound(history_.begin(), history_.end(), time,
                                      [](const auto& entry, Instant t) { return entry.first < t; });
  if (after == history_.end()) return history_.back().second;
  if (after == history_.begin()) return history_.front().second;
  const auto before = std::prev(after);
  const double share =
      static_cast<double>((time - before->first).ns) / static_cast<double>((after->first - before->first).ns);
  Position between{};
  for (std::size_t i = 0; i < between.size(); ++i)
    between[i] = before->second[i] + share * (after->second[i] - before->second[i]);
  return between;
}

void FrameCamera::publish(Picture& picture, std::uint64_t request) {
  Pixels& pixels = picture.pixels;
  if (pixels.bytes.empty()) throw std::runtime_error{"a picture without pixels"};
  if (pixels.bytes.size() > most_pixels)
    throw std::runtime_error{"a picture of " + std::to_string(pixels.bytes.size()) +
                             " bytes; a frame holds 2 MiB: choose a smaller format"};
  stamp(sample_, picture.at);
  sample_.sensor(id);
  sample_.number(number_);
  sample_.request(request);
  sample_.width(static_cast<std::uint32_t>(pixels.width));
  sample_.height(static_cast<std::uint32_t>(pixels.height));
  sample_.format(pixels.wide ? image::PIXEL_MONO16 : image::PIXEL_MONO8);
  sample_.exposure_ns(Duration::seconds(parameters_.exposure).ns);
  sample_.position() = position_at(picture.at);
  sample_.pixels().swap(pixels.bytes);
  frame_.write(sample_);
}

bool FrameCamera::is_due(const Tick& tick) {
  if (!(parameters_.rate > 0.0)) return false;
  if (!free_running_) due_ = tick.now;
  free_running_ = true;
  if (tick.now < due_) return false;
  // Frames that could not be taken in time are left out, not made up for.
  do due_ += Duration::seconds(1.0 / parameters_.rate);
  while (due_ <= tick.now);
  return true;
}

void FrameCamera::step(const Tick& tick) noexcept {
  try {
    follow_stage(tick);
    watch();
    image::ExposeCommand command;
    while (expose_.take(command)) {
      request_ = command.id();
      requested_ = tick.now;
    }
    const bool due = is_due(tick);
    Picture picture;
    picture.at = tick.now;
    if ((!due && request_ == 0) || !take_picture(tick, number_ + 1, picture)) return;
    // A device may have had this picture before it was asked for one: then the next answers.
    const bool answers = request_ != 0 && picture.at >= requested_;
    if (!due && !answers) return;
    ++number_;
    publish(picture, answers ? request_ : 0);
    if (answers) request_ = 0;
  } catch (const std::exception& error) {
    failure_ = error.what();
    fail(failure_.c_str());
  }
}

}  // namespace invar::vision
