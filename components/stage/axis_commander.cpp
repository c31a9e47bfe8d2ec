// Answer of a stage to the loss of the commander of its motion.
#include <array>
#include <cstdio>
#include <utility>

#include "components/stage/axis_stage.hpp"

namespace invar::stage {

/// The axis makes a controlled stop and is held under power; a new command moves it again.
void Stage::look_for_commander(const Tick& tick) noexcept {
  const auto* link = commander_.latest();
  if (link == nullptr) return;
  std::array<char, 300> text{};
  if (Duration{link->silence_ns()} < Duration::seconds(parameters_.commander_timeout)) {
    if (!std::exchange(without_commander_, false)) return;
    std::snprintf(text.data(), text.size(), "its commander, %s, is heard", link->who().c_str());
    return notices_.say(event::SEVERITY_NOTE, text.data());
  }
  if (mode_ != AXIS_MODE_MOVING && mode_ != AXIS_MODE_HOMING) return;
  if (std::exchange(without_commander_, true)) return;
  const bool stops = parameters_.lost_commander == "stop";
  std::array<char, 64> since{"it has ended"};
  if (link->silence_ns() != INT64_MAX)
    std::snprintf(since.data(), since.size(), "not heard for %lld ms",
                  static_cast<long long>(link->silence_ns() / 1'000'000));
  std::snprintf(text.data(), text.size(), "%s: its commander, %s, is lost (%s)",
                stops ? "stopped" : "goes on to the end of its motion, as `lost_commander` says",
                link->who().c_str(), since.data());
  notices_.say(event::SEVERITY_FAULT, text.data());
  if (!stops) return;
  in_vain_ = true;
  brake(setpoint(tick), tick);
}

}  // namespace invar::stage
