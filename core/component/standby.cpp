#include "core/component/standby.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace invar {

namespace {

/// A component that starts alone waits for so long for one that leads already.
constexpr Duration start_wait = Duration::seconds(2.0);
constexpr double unfit_for =
    1.0;  // s, until another one takes the place of a leader that does not reach its device
constexpr int farewells = 5;  // best effort: some may be lost

}  // namespace

void Standby::activate() noexcept {
  has_state_ = leaving_ = waits_for_device_ = other_resigned_ = listens_ = was_heard_ = false;
  unfit_steps_ = 0;
  own_.fit(true);
  nobody_since_.reset();
  asked_ = nobody_ = hands_over_ = is_needed_ = has_handed_over_ = false;
  unready_ = nullptr;
  silent_steps_ = 0;
  received_ = in_.received();
  active_since_ = last_step_ = heard_ = leader_heard_ = owner_.now();
  own_.resigned(false);
  leads_ = !pair_ || (owner_.simulated_time && !pair_->is_spare);
}

void Standby::resign() noexcept {
  if (!pair_) return;
  leads_ = is_needed_ = false;
  has_state_ = false;
  own_.resigned(true);
  for (int i = 0; i < farewells; ++i) write();
}

void Standby::write() noexcept {
  if (!leads()) owner_.stamp(own_);  // times of a leader's state are against the stamp that it had
  own_.component_id(owner_.id);
  own_.leads(leads());
  own_.asks(own_.fit() && asked_.load(std::memory_order_relaxed));
  own_.knows(leads() || has_state_);
  own_.process_id(static_cast<std::uint32_t>(pair_->process));
  out_.write(own_);
}

/// In simulated time a process that is lost stops time itself: nobody takes over.
Standby::Duty Standby::look(const Tick& tick) noexcept {
  if (!pair_ || owner_.simulated_time) return leads() ? Duty::lead : Duty::stand_by;
  // One lost period of a slow loop, or half of what makes the other take over.
  const double longest = std::max(1.5 * tick.period, 0.5 * pair_->deadline.in_seconds());
  const bool stood_still = (tick.now - last_step_).in_seconds() > longest &&
                           last_step_ - heard_ <= pair_->deadline;  // there was somebody who could take over
  last_step_ = tick.now;
  hear();
  is_needed_.store(must_stay(tick), std::memory_order_release);
  return leads() ? lead(tick, stood_still) : stand_by(tick);
}

void Standby::hear() noexcept {
  const auto* other = in_.latest();
  const std::uint64_t received = in_.received();
  if (other == nullptr || received == received_) {
    silent_steps_ = std::min(silent_steps_ + 1, 1'000'000);
    return;
  }
  received_ = received;
  silent_steps_ = 0;
  was_heard_ = true;
  heard_ = in_.arrived();
  waits_for_device_ = false;
  other_process_.store(static_cast<std::int32_t>(other->process_id()), std::memory_order_release);
  other_resigned_ = other->resigned();
  if (leads()) return;
  if (other->leads()) {
    state_ = *other;
    has_state_ = true;
    leader_heard_ = heard_;
  } else if (other->resigned() && !asked_) {  // who asked goes on from what was handed over
    has_state_ = false;
  }
  own_.term(std::max(own_.term(), other->term()));
}

/// By the clock and by own steps: who stood still himself has missed beats that were there.
bool Standby::is_silent(const Tick& tick) const noexcept {
  const double deadline = pair_->deadline.in_seconds();
  return (tick.now - heard_).in_seconds() > deadline && silent_steps_ * tick.period >= deadline;
}

bool Standby::must_stay(const Tick& tick) noexcept {
  if (!was_heard_) return false;
  const auto& other = *in_.latest();
  const bool silent = is_silent(tick);
  if (leads()) return silent || (other.fit() && !other.leads());
  return !silent && (has_handed_over_ ? !other.leads() : other.leads() && !other.fit());
}

Standby::Duty Standby::lead(const Tick& tick, bool stood_still) noexcept {
  const auto* other = in_.latest();
  const bool heard = other != nullptr && silent_steps_ == 0;
  if (heard && other->leads() &&
      (other->term() > own_.term() || (other->term() == own_.term() && pair_->is_spare))) {
    step_down(event::SEVERITY_WARNING, " leads by now");
    return Duty::stand_by;
  }
  if (heard && other->asks() && !other->leads() && !leaving_) {
    has_handed_over_ = hands_over_.load(std::memory_order_acquire);
    step_down(event::SEVERITY_NOTE, own_.fit() ? " was asked to lead" : " can go on");
    return Duty::stand_by;
  }
  if (stood_still) listens_since_ = tick.now;
  listens_ = stood_still || (listens_ && !has_listened(tick, heard));
  return listens_ ? Duty::stand_by : Duty::lead;
}

/// To a beat that was made since: those before waited in a socket while this one stood still. Clocks that are apart do not
/// hold it up for ever.
bool Standby::has_listened(const Tick& tick, bool heard) const noexcept {
  const Duration listened = tick.now - listens_since_;
  const bool is_new = heard && Instant{in_.made()} + Duration::seconds(tick.period) >= listens_since_;
  return is_new || (listened > pair_->deadline && is_silent(tick)) || listened > pair_->deadline * 3;
}

void Standby::yield() noexcept {
  leads_ = false;
  has_state_ = true;
  listens_ = false;
  state_ = own_;
  leader_heard_ = last_step_;
  is_unsure_ = true;
  say(event::SEVERITY_WARNING, "reaches neither its device nor ",
      ", which may lead by now: commands no more until it knows");
}

void Standby::step_down(event::Severity level, const char* why) noexcept {
  leads_ = false;
  has_state_ = true;
  listens_ = false;
  state_ = own_;
  if (const auto* other = in_.latest(); other != nullptr && other->leads()) state_ = *other;
  own_.term(std::max(own_.term(), state_.term()));
  say(level, "stands by: ", why);
}

Standby::Duty Standby::stand_by(const Tick& tick) noexcept {
  if (leaving_ && (!asked_ || other_resigned_)) return Duty::stand_by;
  const auto* other = in_.latest();
  const bool heard = other != nullptr && silent_steps_ == 0 && !has_ended();  // its last beats say nothing
  if (heard && other->leads()) {
    if (std::exchange(is_unsure_, false)) say(event::SEVERITY_NOTE, "stands by: ", " leads by now");
    nobody_ = false;
    nobody_since_.reset();
    unfit_steps_ = other->fit() || !own_.fit() || has_handed_over_ ? 0 : unfit_steps_ + 1;
    if (unfit_steps_ * tick.period > unfit_for) asked_ = true;
    return Duty::stand_by;
  }
  return heard ? beside_one_that_does_not_lead(tick) : beside_nobody(tick);
}

Standby::Duty Standby::beside_one_that_does_not_lead(const Tick& tick) noexcept {
  const auto& other = *in_.latest();
  if (asked_)
    return found_missing(unfit_steps_ > 0 ? "it said that it cannot go on" : "it was asked to lead", true);
  if (!nobody_since_) nobody_since_ = tick.now;
  nobody_ = other.resigned() || tick.now - *nobody_since_ > start_wait;
  if (other.resigned() || other.asks()) return Duty::stand_by;
  if (has_state_ && !other.knows()) return found_missing("it began anew", true);
  if (!has_state_ && !other.knows() && !pair_->is_spare) return found_missing("", true);
  // Both know and neither leads: as when one hands over and the other dies in that moment.
  if (!pair_->is_spare && has_state_ && tick.now - *nobody_since_ > pair_->deadline * 3)
    return found_missing("it does not lead either", true);
  return Duty::stand_by;
}

bool Standby::has_ended() const noexcept {
  const std::int32_t process = other_process_.load(std::memory_order_acquire);
  return process != 0 && ended_process_.load(std::memory_order_acquire) == process;
}

Standby::Duty Standby::beside_nobody(const Tick& tick) noexcept {
  const bool ended = has_ended();
  const bool silent = is_silent(tick);
  if (!ended && !silent) return Duty::stand_by;
  if (asked_) return found_missing("it was asked to lead", ended);
  if (other_resigned_) {
    nobody_ = true;
    return Duty::stand_by;
  }
  if (has_state_) return found_missing(ended ? "its process has ended" : "its beats stay away", ended);
  const bool alone = tick.now - active_since_ > start_wait;
  if (alone && !pair_->is_spare) return found_missing("it is not heard", ended);
  nobody_ = alone;
  return Duty::stand_by;
}

Standby::Duty Standby::found_missing(const char* why, bool is_certain) noexcept {
  why_ = why;
  is_certain_ = is_certain;
  return Duty::missing;
}

void Standby::wait_for_device(const char* why) noexcept {
  if (std::exchange(waits_for_device_, true)) return;
  say(event::SEVERITY_WARNING, "does not lead: not heard is ", why);
}

void Standby::begin_to_lead(bool with_state) noexcept {
  const std::uint64_t before = own_.term();
  own_.term(before + 1);
  const bool had_state = std::exchange(has_state_, false);
  nobody_ = asked_ = false;
  is_unsure_ = false;
  unfit_steps_ = 0;
  nobody_since_.reset();
  waits_for_device_ = false;
  leads_ = true;
  if (*why_ == '\0') return;  // both start, and this one leads by the file
  std::array<char, 160> end{};
  std::snprintf(end.data(), end.size(), " (%s)%s", why_,
                with_state  ? ", and goes on from its state"
                : had_state ? "; its state is that of another version, so it begins anew"
                            : "");
  say(had_state ? event::SEVERITY_WARNING : event::SEVERITY_NOTE,
      had_state ? "took over from " : "leads: beside ", end.data());
}

void Standby::say(event::Severity level, const char* begin, const char* end) noexcept {
  std::array<char, 480> text{};
  std::snprintf(text.data(), text.size(), "%s%s%s", begin, pair_->other.c_str(), end);
  notices_.say(level, text.data());
}

bool Standby::ask() noexcept {
  if (!pair_ || leads()) return false;
  asked_ = true;
  return true;
}

const char* Standby::role() const noexcept {
  if (!pair_) return "";
  if (!leads()) return "standby";
  return pair_->is_spare ? "took over" : "active";
}

std::string Standby::fault() const {
  if (!pair_ || leads()) return {};
  if (nobody_)
    return "nobody leads: " + pair_->other + " was deactivated, never heard, or cannot; " + pair_->command;
  const char* why = unready_.load(std::memory_order_acquire);
  return why == nullptr ? "" : std::string{"could not take over: "} + why;
}

void Standby::look_for_process(bool (*is_alive)(std::int32_t process)) {
  const std::int32_t process = other_process_.load(std::memory_order_acquire);
  if (!pair_ || !pair_->is_same_pc || process == 0 || process == ended_process_) return;
  if (is_alive(process))
    seen_process_ = process;
  else if (seen_process_ == process)  // one that this process cannot see says nothing
    ended_process_.store(process, std::memory_order_release);
}

void Standby::hear_of_end(std::int32_t process) noexcept {
  if (process != 0 && process == other_process_.load(std::memory_order_acquire))
    ended_process_.store(process, std::memory_order_release);
}

}  // namespace invar
