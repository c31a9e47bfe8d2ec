// How a stage stands by for another one, and goes on with the motion in its place.
#include "components/stage/axis_stage.hpp"

namespace invar::stage {

bool Stage::leads(const Tick& tick, bool seeing) noexcept {
  standby_.fit(seeing);
  switch (standby_.look(tick)) {
    case Standby::Duty::lead:
      return true;
    case Standby::Duty::stand_by:
      return false;
    case Standby::Duty::missing:
      break;
  }
  if (!seeing) return false;  // it could not go on
  const Instant heard = standby_.heard();
  begin_control(tick);  // the state below is for this rate
  standby_.take_over(*this);
  go_on_for_other(tick);
  // What is neither proportional nor fed forward is the controller's sum; the rate of change is near none.
  if (mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT)
    (void)controller_.go_on_from(current_ - fed_forward_.last, following_error_,
                                 tick.period / tick.own_period);
  model_.announce();
  // What the one before may not have heard any more, or not told.
  for (std::size_t i = 0; i < unanswered_.size(); ++i) {
    const Unanswered& next = unanswered_[(unanswered_next_ + i) % unanswered_.size()];
    if (next.at > heard - Duration::seconds(2.0 * tick.period) && next.command.id() != sample_.command_id())
      obey(next.command, tick);
  }
  unanswered_ = {};
  return true;
}

/// The state is that of the last step of the other. A search for the zero is not handed over: the axis stops.
void Stage::go_on_for_other(const Tick& tick) noexcept {
  blind_ = without_correction_ = without_commander_ = false;
  outside_at_ = tick.now;
  const bool outside = mode_ == AXIS_MODE_MOVING && !parameters_.travel.contains(trajectory_.target());
  if (mode_ != AXIS_MODE_HOMING && !outside) return;
  in_vain_ = true;
  brake(setpoint(tick), tick);
}

/// Reads, and drives nothing. A leader that only listens for a moment keeps its mode and its commands.
void Stage::stand_by(const Tick& tick, bool seeing) noexcept {
  if (!standby_.leads()) {
    AxisCommand command;
    while (command_.take(command)) {
      unanswered_[unanswered_next_] = {command, tick.now};
      unanswered_next_ = (unanswered_next_ + 1) % unanswered_.size();
    }
    mode_ = AXIS_MODE_DISABLED;
    blind_ = false;
    standby_.unready(seeing ? nullptr : "no feedback comes");
  }
  standby_.tell();
}

}  // namespace invar::stage
