// What a stage does when feedback, fused position or correction stay away or are no numbers.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "components/stage/axis_stage.hpp"

namespace invar::stage {

/// What of the inputs is no number; nullptr: nothing.
const char* Stage::unusable(const AxisFeedback& feedback) noexcept {
  const auto* fused = fused_.latest();
  const auto* correction = correction_.latest();
  if (!std::isfinite(feedback.position()) || !std::isfinite(feedback.velocity()))
    return "the encoder's position or velocity is not a number";
  if (fused != nullptr && fused->valid() && !std::isfinite(fused->position()))
    return "the fused position is not a number";
  if (correction != nullptr && !std::isfinite(correction->correction()))
    return "the correction is not a number";
  return nullptr;
}

/// Position is not known any more: brake along the stopping trajectory on feedforward alone, then let go, or stand with the
/// current that held before.
void Stage::stop_blindly(const char* why, const Tick& tick) noexcept {
  const bool holds = parameters_.on_lost_input == "hold";
  if (!blind_) {
    blind_ = true;
    blind_because_ = why;
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(), "brakes without feedback, then %s: %s",
                  holds ? "holds" : "disables the drive", why);
    notices_.say(event::SEVERITY_FAULT, text.data());
    if (moves()) in_vain_ = true;
    brake(setpoint(tick), tick);
  }
  const double limit = parameters_.control.limit;
  current_ = std::clamp(feedforward(tick) + (holds ? standing_current_ : 0.0), -limit, limit);
  if (!has_arrived(tick)) return;
  if (!holds) {
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(), "braked without feedback and tripped: %s", blind_because_);
    return trip(text.data());
  }
  mode_ = disabling_ ? AXIS_MODE_DISABLED : AXIS_MODE_HOLDING;
  disabling_ = false;
  sample_.command_done(true);
  if (std::exchange(in_vain_, false)) sample_.command_refused(true);
}

/// Sight came back: too late for a drive that is to be disabled; else the axis comes to rest where it is now.
void Stage::see_again(const AxisFeedback& feedback, const Tick& tick) noexcept {
  if (parameters_.on_lost_input != "hold")
    return trip("tripped: feedback was lost, and came back while it braked");
  blind_ = false;
  notices_.say(event::SEVERITY_NOTE, "feedback is back: holds where it stands");
  prime(tick);
  brake({position_ - correction_held_, feedback.velocity(), 0.0}, tick);
}

/// A correction that stays away is held where it was, and the axis comes to rest.
void Stage::look_for_correction(const Tick& tick) noexcept {
  const bool lost =
      correction_watch_.lost(correction_.received(), parameters_.feedback_timeout / tick.period);
  const bool driving = mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT;
  if (!lost || leaving_) {
    if (std::exchange(without_correction_, false) && !leaving_)
      notices_.say(event::SEVERITY_NOTE, "the correction is back");
    return;
  }
  const bool holds = parameters_.on_lost_input == "hold";
  if (driving && !blind_ && !std::exchange(without_correction_, true)) {
    notices_.say(event::SEVERITY_FAULT,
                 holds ? "the correction stays away: brakes and holds, and takes no moves"
                       : "the correction stays away: brakes, then disables the drive");
    if (mode_ == AXIS_MODE_MOVING || mode_ == AXIS_MODE_HOMING) {
      in_vain_ = true;
      brake(setpoint(tick), tick);
    }
  }
  if (without_correction_ && !holds && mode_ == AXIS_MODE_HOLDING)
    trip("braked and tripped: the correction stays away");
}

}  // namespace invar::stage
