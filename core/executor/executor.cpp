// The part of the executor that steps. Everything here but the constructor runs in the loop.
#include "core/executor/executor.hpp"

#include <algorithm>
#include <exception>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"
#include "core/executor/slot.hpp"

namespace invar {

namespace {

std::string lost_text(const InputPort& input) {
  const double ms = input.options().deadline.in_seconds() * 1e3;
  std::string digits = std::to_string(ms);
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return "input `" + input.name() + "` lost: nothing came within its deadline of " + digits + " ms";
}

}  // namespace

Executor::Executor(ExecutorOptions options) : options_{std::move(options)}, box_{options_.black_box} {
  INVAR_EXPECTS(options_.period.ns > 0, options_.period.ns);
}

Executor::~Executor() {
  end_loop();  // and no more: what the outputs are connected to may be gone
  box_.stop();
}

std::size_t Executor::add(std::unique_ptr<Component> component, Placement placement) {
  INVAR_EXPECTS(!is_prepared_, placement.type);
  INVAR_EXPECTS(component != nullptr && placement.every > 0, placement.type, placement.every);
  auto slot = std::make_unique<Slot>();
  slot->storage = std::move(placement.storage);
  slot->component = std::move(component);
  slot->type = std::move(placement.type);
  slot->every = placement.every;
  slot->index = slots_.size();
  slot->infos = std::move(placement.parameters);
  slot->check = std::move(placement.check);
  for (const ParameterInfo& info : slot->infos)
    slot->values.emplace_back(info.number != nullptr ? *info.number : 0.0);
  for (Port* port : slot->component->ports()) {
    if (port->direction() == Port::Direction::output) {
      slot->outputs.push_back(static_cast<OutputPort*>(port));
      continue;
    }
    const auto* input = static_cast<const InputPort*>(port);
    if (input->options().deadline.ns > 0) slot->deadlines.push_back({input, lost_text(*input)});
    if (const auto limit = placement.latencies.find(input->name()); limit != placement.latencies.end()) {
      Slot::Age& age = slot->ages.emplace_back();
      age.input = input;
      age.limit = limit->second;
    }
  }
  if (auto* redundant = dynamic_cast<Redundant*>(slot->component.get()))
    slot->standby = &redundant->standby();
  slots_.push_back(std::move(slot));
  return slots_.size() - 1;
}

Instant Executor::now() const noexcept {
  return options_.simulated ? Instant{now_ns_.load(std::memory_order_acquire)} : utc_now();
}

void Executor::advance_to(Instant until) {
  INVAR_EXPECTS(options_.simulated);
  prepare();
  {
    const std::lock_guard turn{stepping_};
    for (;;) {
      const Instant due{options_.period.ns * static_cast<std::int64_t>(count_.executed)};
      if (due >= until) break;
      now_ns_.store(due.ns, std::memory_order_release);
      run_cycle(due, count_.executed, 1);
      close_cycle(due, {}, {});
    }
    if (until.ns > now_ns_.load(std::memory_order_relaxed))
      now_ns_.store(until.ns, std::memory_order_release);
  }
  box_.deliver();
}

void Executor::run_cycle(Instant now, std::uint64_t cycle, std::uint32_t stretch) noexcept {
  count_.cycle = cycle;
  count_.now = now;
  next_cycle_ = cycle;
  obey(now);
  for (const auto& slot : slots_)
    if (slot->state.load(std::memory_order_acquire) == LifecycleState::active)
      step(*slot, now, cycle, stretch);
}

void Executor::step(Slot& slot, Instant now, std::uint64_t cycle, std::uint32_t stretch) noexcept {
  if (cycle < slot.next_due) return;
  const std::uint64_t every = (slot.every + stretch - 1) / stretch * stretch;
  slot.next_due = (cycle / every + 1) * every;
  const auto seconds = [&](std::uint64_t periods) {
    return (options_.period * static_cast<std::int64_t>(periods)).in_seconds();
  };
  const Tick tick{now, seconds(every), cycle, seconds(slot.every)};
  Component& component = *slot.component;
  component.set_now(now, cycle);
  if (!inputs_alive(slot, tick)) return;
  const Instant begin = options_.simulated ? Instant{} : monotonic_now();
  if (!options_.simulated) watch_ages(slot, utc_at(begin));
  component.run_step(tick);
  if (!options_.simulated) slot.compute.add(monotonic_now() - begin);
  slot.steps.store(slot.steps.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (component.failure() != nullptr) {
    go_to_error(slot, component.failure(), now);
  } else if (!slot.bump_checked) {
    check_bump(slot, now);
  }
}

bool Executor::inputs_alive(Slot& slot, const Tick& tick) noexcept {
  for (const Slot::Deadline& deadline : slot.deadlines) {
    const InputPort& input = *deadline.input;
    if (input.options().optional && input.received() == 0) continue;
    const Instant since = std::max(input.arrived(), slot.active_since);
    Duration age = tick.now - since;
    // While this loop itself stood still nobody could feed it: that time is not the source's fault.
    if (since < stall_end_) age = age - (stall_end_ - std::max(since, stall_end_ - stall_));
    // And while it runs at a lower rate, its own sources do too.
    const Duration limit = count_.stretch == 1
                               ? input.options().deadline
                               : std::max(input.options().deadline, options_.period * 2 * count_.stretch);
    if (age <= limit) continue;
    if (slot.component->input_lost(input, tick)) continue;
    go_to_error(slot, deadline.failure, tick.now);
    return false;
  }
  return true;
}

void Executor::watch_ages(Slot& slot, Instant now) noexcept {
  for (Slot::Age& watched : slot.ages) {
    const Instant made = watched.input->made();
    if (made.ns == INT64_MIN) continue;  // nothing arrived yet
    const Duration age = now - made;
    watched.age.add(age);
    if (age <= watched.limit) continue;
    watched.late.store(watched.late.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    late_input_ = true;
  }
}

void Executor::check_bump(Slot& slot, Instant now) noexcept {
  bool known = true;
  for (const auto& [setpoint, measured, tolerance] : slot.component->bumpless()) {
    const double jump = *setpoint - *measured;
    if (!(jump >= -1e300 && jump <= 1e300)) {
      known = false;  // one of them is not known yet
    } else if (jump > tolerance || jump < -tolerance) {
      go_to_error(slot, "activation would jump: its setpoint does not start at the measured value", now);
      return;
    }
  }
  slot.bump_checked = known;
}

void Executor::obey(Instant now) noexcept {
  if (trip_requested_.exchange(false, std::memory_order_acq_rel))
    stop_safely(requested_reason_.read().data(), now);
  if (freeze_requested_.exchange(false, std::memory_order_acq_rel))
    box_.trip("", "asked for", now, count_.cycle);
  Command command;
  std::uint64_t obeyed = 0;
  while (commands_.pop(command)) {
    Slot& slot = *slots_[command.slot];
    switch (command.kind) {
      case Command::Kind::activate:
        activate(slot, now);
        break;
      case Command::Kind::deactivate:
        wind_down(slot, now, true);
        break;
      case Command::Kind::wind_down:
        for (const auto& each : slots_) wind_down(*each, now, false);
        break;
      case Command::Kind::set_parameter:
        *slot.infos[command.parameter].number = command.value;
        slot.values[command.parameter].store(command.value, std::memory_order_relaxed);
        slot.parameters_dirty = true;
        break;
      case Command::Kind::reset_latch:
        slot.component->set_now(now, count_.cycle);
        slot.component->reset_latch();
        break;
      case Command::Kind::clear_histograms:
        wake_up_.clear();
        compute_.clear();
        latency_.clear();
        for (const auto& each : slots_) {
          each->compute.clear();
          for (Slot::Age& watched : each->ages) watched.age.clear();
        }
        break;
      case Command::Kind::clear_trip:
        count_.tripped = false;
        trip_reason_.write({});
        break;
    }
    ++obeyed;
  }
  take_down(now);
  if (obeyed == 0) return;
  for (const auto& slot : slots_) {
    if (!slot->parameters_dirty) continue;
    slot->parameters_dirty = false;
    const LifecycleState state = slot->state.load(std::memory_order_relaxed);
    if (state != LifecycleState::active && state != LifecycleState::inactive) continue;
    slot->component->set_now(now, count_.cycle);
    slot->component->parameters_changed();
  }
  counters_.write(count_);
  obeyed_.fetch_add(obeyed, std::memory_order_release);
}

void Executor::activate(Slot& slot, Instant now) noexcept {
  if (count_.tripped || slot.state.load(std::memory_order_relaxed) != LifecycleState::inactive) return;
  Component& component = *slot.component;
  component.set_now(now, count_.cycle);
  component.clear_failure();
  for (Port* port : component.ports())
    if (port->direction() == Port::Direction::inbox) static_cast<InputPort*>(port)->discard();
  slot.active_since = now;
  slot.next_due = (next_cycle_ + slot.every - 1) / slot.every * slot.every;
  slot.bump_checked = component.bumpless().empty();
  try {
    component.activate();
  } catch (const std::exception& reason) {
    go_to_error(slot, reason.what(), now);
    return;
  }
  if (component.failure() != nullptr) {
    go_to_error(slot, component.failure(), now);
    return;
  }
  change_state(loop_changes_, slot, LifecycleState::active, now);
  if (!slot.bump_checked) check_bump(slot, now);
}

/// In simulated time the clock may be over, by the clock the loop may not run: then nobody can brake.
bool Executor::is_stepped() const noexcept {
  return options_.simulated ? !stop_requested_.load(std::memory_order_acquire) : is_running();
}

void Executor::wind_down(Slot& slot, Instant now, bool leave) noexcept {
  if (slot.state.load(std::memory_order_relaxed) != LifecycleState::active) return;
  if (!slot.winding) slot.leave_by = now + options_.wind_down;
  at_rest_.store(false, std::memory_order_release);  // nobody has looked yet
  slot.winding = winding_ = true;
  slot.leaving = slot.leaving || leave;
}

/// Deactivates what is to leave and rests, downstream first; what a braking component reads stays with it.
void Executor::take_down(Instant now) noexcept {
  if (!winding_) return;
  const bool may_wait = is_stepped();
  bool at_rest = true;
  for (const auto& slot : slots_) {
    slot->braking = false;
    if (!slot->winding || !may_wait || now >= slot->leave_by) continue;
    slot->component->set_now(now, count_.cycle);
    slot->braking = !slot->component->wind_down();
    at_rest = at_rest && !slot->braking;
  }
  at_rest_.store(at_rest, std::memory_order_release);
  winding_ = false;
  for (const std::size_t index : take_down_order_) {
    Slot& slot = *slots_[index];
    const bool needed = std::any_of(slot.signalled.begin(), slot.signalled.end(),
                                    [](const Slot* reader) { return reader->braking; });
    if (slot.leaving && !slot.braking && !needed) deactivate(slot, now);
    winding_ = winding_ || slot.winding;
  }
}

void Executor::deactivate(Slot& slot, Instant now) noexcept {
  if (slot.state.load(std::memory_order_relaxed) != LifecycleState::active) return;
  Component& component = *slot.component;
  component.set_now(now, count_.cycle);
  const bool clock_is_over = options_.simulated && !is_stepped();
  const bool moves = !clock_is_over && !component.wind_down();
  const bool commands = slot.commands();
  component.deactivate();
  if (commands) slot.write_safe_values();
  constexpr std::string_view why =
      "it was deactivated while it still moved: its time to come to rest was over";
  change_state(loop_changes_, slot, LifecycleState::inactive, now, moves ? why : std::string_view{});
  if (moves) box_.trip(slot.error_prefix, why, now, count_.cycle);
}

void Executor::go_to_error(Slot& slot, std::string_view why, Instant now) noexcept {
  if (slot.commands()) slot.write_safe_values();
  change_state(loop_changes_, slot, LifecycleState::error, now, why);
  box_.trip(slot.error_prefix, why, now, count_.cycle);
}

void Executor::deactivate_all(Instant now) noexcept {
  for (const auto& slot : slots_) wind_down(*slot, now, true);
  take_down(now);
}

void Executor::stop_safely(std::string_view why, Instant now) noexcept {
  if (count_.tripped) return;
  deactivate_all(now);
  count_.tripped = true;
  const FailureText reason = failure_text(why);
  trip_reason_.write(reason);
  counters_.write(count_);
  box_.trip("", reason.data(), now, count_.cycle);
}

void Executor::change_state(Ring<StateChange>& ring, Slot& slot, LifecycleState to, Instant now,
                            std::string_view why) noexcept {
  const FailureText text = failure_text(why);
  slot.failure.write(text);
  if (&ring == &loop_changes_) slot.winding = slot.leaving = slot.braking = false;
  const LifecycleState from = slot.state.exchange(to, std::memory_order_acq_rel);
  ring.push({now, static_cast<std::uint32_t>(slot.index), from, to, text});
}

void Executor::close_cycle(Instant now, Duration wake_up, Duration compute) noexcept {
  ++count_.executed;
  next_cycle_ = count_.cycle + 1;
  counters_.write(count_);
  CycleRecord record{count_.cycle, now, wake_up, compute, count_.overruns, count_.skipped, {}};
  for (std::size_t i = 0; i < std::min(slots_.size(), record.states.size()); ++i)
    record.states[i] = slots_[i]->state.load(std::memory_order_relaxed);
  box_.add(record);
}

}  // namespace invar
