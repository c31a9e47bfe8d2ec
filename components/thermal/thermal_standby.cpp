// How a temperature loop stands by for another one, and goes on in its place.
#include "components/thermal/thermal.hpp"

namespace invar::thermal {

bool Thermal::leads(const Tick& tick) noexcept {
  if (!standby_.paired()) return true;
  standby_.fit(reaches_device());
  switch (standby_.look(tick)) {
    case Standby::Duty::lead:
      // The other takes over later than this: see why_not_free.
      if (!simulated_time && standby_.is_in_doubt(tick) && !reaches_device()) {
        standby_.yield();
        return false;
      }
      return true;
    case Standby::Duty::stand_by:
      return false;
    case Standby::Duty::missing:
      break;
  }
  if (const char* why = standby_.is_certain() ? nullptr : why_not_free(tick); why != nullptr) {
    // What the device shows is not known at once: that is worth no word.
    if (tick.now - standby_.heard() > Duration::seconds(2.0)) standby_.wait_for_device(why);
    return false;
  }
  standby_.take_over(*this);
  // The one before may not have heard it any more. To obey it twice is to obey it once.
  if (unanswered_ && unanswered_at_ > standby_.heard() - Duration::seconds(tick.period)) obey(*unanswered_);
  unanswered_.reset();
  return true;
}

/// It has answered within two polls.
bool Thermal::reaches_device() const noexcept {
  const modbus::Reading beat = client_.device().value(map_.heartbeat->reg);
  return !beat.stale && beat.age <= map_.poll * 2;
}

/// Somebody commands the device, or nobody can tell; nullptr: its heartbeat stands still. A leader without a link to the
/// device and the other ends two polls and a step after its last answer; its heartbeat may be a period older.
const char* Thermal::why_not_free(const Tick& tick) const noexcept {
  const modbus::Heartbeat& heartbeat = *map_.heartbeat;
  const Duration still = heartbeat.period * 2 + map_.poll * 2;
  if (!beat_changed_) return ", and the device does not answer here either";
  return tick.now - *beat_changed_ < still
             ? ", but its device still gets its heartbeat: look at the link between the PCs"
             : nullptr;
}

/// Reads, and neither writes nor shows life to the device. A leader that only listens for a moment keeps its commands.
void Thermal::stand_by(const Tick& tick) noexcept {
  if (standby_.leads()) return standby_.tell();
  client_.device().forget_writes();
  ThermalCommand command;
  while (command_.take(command)) {
    unanswered_ = command;
    unanswered_at_ = tick.now;
  }
  setpoint_parameter_ = parameters_.setpoint;
  if (!simulated_time) watch_device(tick);
  standby_.tell();
}

void Thermal::watch_device(const Tick& tick) noexcept {
  const modbus::Reading beat = client_.device().value(map_.heartbeat->reg);
  if (beat.is_sound() && (!beat_changed_ || beat.value != beat_)) beat_changed_ = tick.now;
  if (!beat.is_sound()) beat_changed_.reset();
  beat_ = beat.value;
  const auto reading = measured(slide_);
  (void)watch_.trusts(watched(), reading, tick.now);
  if (reading) temperature_ = *reading;
  if (reading) unready_since_.reset();
  if (!reading && !unready_since_) unready_since_ = tick.now;
  constexpr Duration patience = Duration::seconds(3.0);
  standby_.unready(unready_since_ && tick.now - *unready_since_ > patience
                       ? "no temperature comes: look at the device and its link from this PC"
                       : nullptr);
}

}  // namespace invar::thermal
