// The executor as its callers see it: transitions, parameters, state. Nothing here runs in the loop.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "core/base/contract.hpp"
#include "core/config/yaml.hpp"
#include "core/executor/dependency.hpp"
#include "core/executor/executor.hpp"
#include "core/executor/slot.hpp"

namespace invar {

void Executor::prepare() {
  std::call_once(prepared_, [this] {
    is_prepared_ = true;
    take_down_order_ = bring_up_order();
    std::reverse(take_down_order_.begin(), take_down_order_.end());
    std::vector<const Component*> components;
    for (const auto& slot : slots_) components.push_back(slot->component.get());
    const auto reach = signals_reach(components);
    for (std::size_t i = 0; i < slots_.size(); ++i)
      for (std::size_t k = 0; k < slots_.size(); ++k)
        if (i != k && reach[i][k]) slots_[i]->signalled.push_back(slots_[k].get());
    std::vector<std::string> names;
    for (const auto& slot : slots_) {
      names.push_back(slot->component->name);
      slot->error_prefix = slot->component->name + ": ";
    }
    box_.start(options_.process, std::move(names), !options_.simulated);
  });
}

const Component& Executor::component(std::size_t index) const { return *slots_.at(index)->component; }
Component& Executor::component(std::size_t index) { return *slots_.at(index)->component; }
const std::string& Executor::type(std::size_t index) const { return slots_.at(index)->type; }
std::uint32_t Executor::every(std::size_t index) const { return slots_.at(index)->every; }
std::uint64_t Executor::steps(std::size_t index) const {
  return slots_.at(index)->steps.load(std::memory_order_relaxed);
}

std::optional<std::size_t> Executor::find(std::string_view name) const {
  for (std::size_t i = 0; i < slots_.size(); ++i)
    if (slots_[i]->component->name == name) return i;
  return std::nullopt;
}

std::vector<std::size_t> Executor::bring_up_order() const {
  std::vector<const Component*> components;
  for (const auto& slot : slots_) components.push_back(slot->component.get());
  return upstream_first(components);
}

LifecycleState Executor::state(std::size_t index) const {
  return slots_.at(index)->state.load(std::memory_order_acquire);
}
std::string Executor::failure(std::size_t index) const { return slots_.at(index)->failure.read().data(); }
std::string Executor::trip_reason() const { return trip_reason_.read().data(); }
HistogramCopy Executor::compute(std::size_t index) const { return slots_.at(index)->compute.copy(); }
std::vector<InputAge> Executor::ages(std::size_t index) const {
  std::vector<InputAge> out;
  for (const Slot::Age& watched : slots_.at(index)->ages)
    out.push_back({watched.input->name(), watched.limit, watched.late.load(std::memory_order_relaxed),
                   watched.age.copy().percentiles()});
  return out;
}
const std::vector<ParameterInfo>& Executor::parameters(std::size_t index) const {
  return slots_.at(index)->infos;
}

std::chrono::nanoseconds Executor::patience() const {
  return std::max(std::chrono::nanoseconds{2'000'000'000}, std::chrono::nanoseconds{options_.period.ns * 4});
}

bool Executor::carry_out(const Command& command) {
  using Clock = std::chrono::steady_clock;
  if (!commands_.push(command)) return false;
  ++commanded_;
  const auto until = Clock::now() + patience();
  while (obeyed_.load(std::memory_order_acquire) < commanded_) {
    if (stepping_.try_lock()) {  // nobody steps: this thread may
      obey(now());
      stepping_.unlock();
      continue;
    }
    if (Clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::microseconds{100});
  }
  return true;
}

/// As long as cycles go by. Where none do any more in simulated time, nobody brakes: it is deactivated as it is.
bool Executor::wait_for_rest(Slot& slot) {
  using Clock = std::chrono::steady_clock;
  auto until = Clock::now() + patience();
  for (std::uint64_t seen = counters().executed; state(slot.index) == LifecycleState::active;) {
    if (const std::uint64_t cycles = counters().executed; cycles != seen) {
      seen = cycles;
      until = Clock::now() + patience();
    }
    const bool late = Clock::now() > until;
    if ((late || !is_stepped()) && stepping_.try_lock()) {
      deactivate(slot, now());
      stepping_.unlock();
    } else if (late) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::microseconds{100});
  }
  return true;
}

void Executor::wind_down_all() {
  const std::lock_guard turn{manager_};
  if (!slots_.empty()) (void)carry_out({Command::Kind::wind_down, 0, 0, 0.0});
}

Outcome Executor::start_or_stop(Slot& slot, Command::Kind kind, LifecycleState target) {
  Outcome outcome;
  bool answered = carry_out({kind, static_cast<std::uint32_t>(slot.index), 0, 0.0});
  if (answered && kind == Command::Kind::deactivate) answered = wait_for_rest(slot);
  outcome.state = slot.state.load(std::memory_order_acquire);
  outcome.verdict = outcome.state == target ? Verdict::done : Verdict::failed;
  if (outcome.ok()) return outcome;
  outcome.reason = answered ? slot.failure.read().data() : "the loop does not answer; it may hang in a step";
  if (outcome.reason.empty()) outcome.reason = "the process stopped safely: " + trip_reason();
  return outcome;
}

Outcome Executor::transition(std::size_t index, Transition transition) {
  prepare();
  const std::lock_guard turn{manager_};
  Slot& slot = *slots_.at(index);
  Component& component = *slot.component;
  const LifecycleState state = slot.state.load(std::memory_order_acquire);
  if (transition == Transition::reset && state == LifecycleState::active && component.has_latch())
    return carry_out({Command::Kind::reset_latch, static_cast<std::uint32_t>(index), 0, 0.0})
               ? Outcome{0, Verdict::done, state, ""}
               : Outcome{0, Verdict::failed, state, "the loop does not answer; it may hang in a step"};
  const Decision decision = decide(state, transition);
  if (decision.kind == Decision::Kind::already) return {0, Verdict::already, state, ""};
  if (decision.kind == Decision::Kind::refused) {
    std::string reason{decision.reason};
    if (state == LifecycleState::error) reason += std::string{" ("} + slot.failure.read().data() + ")";
    return {0, Verdict::refused, state, std::move(reason)};
  }
  const auto become = [&](LifecycleState to, std::string_view why = {}) {
    change_state(manager_changes_, slot, to, now(), why);
  };
  switch (transition) {
    case Transition::configure:
      component.set_now(now());
      component.clear_failure();
      try {
        component.configure();
      } catch (const std::exception& reason) {
        become(LifecycleState::error, reason.what());
        return {0, Verdict::failed, LifecycleState::error, reason.what()};
      }
      if (component.failure() != nullptr) {
        become(LifecycleState::error, component.failure());
        return {0, Verdict::failed, LifecycleState::error, component.failure()};
      }
      become(LifecycleState::inactive);
      break;
    case Transition::activate:
      if (counters().tripped)
        return {0, Verdict::refused, state,
                "the process stopped safely (" + trip_reason() + "); reset it first"};
      return start_or_stop(slot, Command::Kind::activate, decision.target);
    case Transition::deactivate:
      return start_or_stop(slot, Command::Kind::deactivate, decision.target);
    case Transition::shutdown:
      if (state == LifecycleState::active) {
        Outcome stopped = start_or_stop(slot, Command::Kind::deactivate, LifecycleState::inactive);
        if (stopped.state == LifecycleState::active) return stopped;
      }
      if (state != LifecycleState::unconfigured) component.cleanup();
      become(LifecycleState::finalized);
      break;
    case Transition::cleanup:
    case Transition::reset:
      component.set_now(now());
      component.cleanup();
      component.clear_failure();
      become(LifecycleState::unconfigured);
      break;
  }
  return {0, Verdict::done, decision.target, ""};
}

std::string Executor::set_parameter(std::size_t index, std::string_view path, double value) {
  prepare();
  const Slot& slot = *slots_.at(index);
  const std::string at = slot.component->name + "." + std::string{path};
  const auto info =
      std::find_if(slot.infos.begin(), slot.infos.end(), [&](const auto& i) { return i.path == path; });
  if (info == slot.infos.end()) {
    std::vector<std::string> paths;
    for (const ParameterInfo& each : slot.infos) paths.push_back(each.path);
    const std::string near = config::nearest(path, paths);
    return at + ": no such parameter" + (near.empty() ? "" : "; did you mean `" + near + "`?");
  }
  if (info->number == nullptr)
    return at + ": it may not change while running; change it in the cell file and start the process again";
  if (!std::isfinite(value) || !info->range.contains(value)) {
    std::ostringstream text;
    const std::string unit = info->unit.empty() ? "" : " " + info->unit;
    text << at << ": " << value << unit << " is outside " << info->range.lower << " .. " << info->range.upper
         << unit;
    return text.str();
  }
  const std::lock_guard turn{manager_};
  const auto which = static_cast<std::size_t>(info - slot.infos.begin());
  if (slot.check) {
    std::vector<double> numbers;
    for (const auto& number : slot.values) numbers.push_back(number.load(std::memory_order_relaxed));
    numbers[which] = value;
    if (const std::string objection = slot.check(numbers); !objection.empty()) return at + ": " + objection;
  }
  const bool answered = carry_out({Command::Kind::set_parameter, static_cast<std::uint32_t>(index),
                                   static_cast<std::uint32_t>(which), value});
  return answered ? "" : at + ": the loop does not answer; it may hang in a step";
}

std::optional<double> Executor::parameter(std::size_t index, std::string_view path) const {
  const Slot& slot = *slots_.at(index);
  for (std::size_t i = 0; i < slot.infos.size(); ++i)
    if (slot.infos[i].path == path && slot.infos[i].number != nullptr)
      return slot.values[i].load(std::memory_order_relaxed);
  return std::nullopt;
}

void Executor::trip(std::string_view reason) {
  const std::lock_guard turn{trip_turn_};
  requested_reason_.write(failure_text(reason));
  trip_requested_.store(true, std::memory_order_release);
}

void Executor::clear_trip() {
  const std::lock_guard turn{manager_};
  if (!slots_.empty()) (void)carry_out({Command::Kind::clear_trip, 0, 0, 0.0});
}

void Executor::clear_histograms() {
  const std::lock_guard turn{manager_};
  if (!slots_.empty()) (void)carry_out({Command::Kind::clear_histograms, 0, 0, 0.0});
}

bool Executor::take_change(StateChange& change) {
  StateChange next;
  if (!next_loop_change_ && loop_changes_.pop(next)) next_loop_change_ = next;
  if (!next_manager_change_ && manager_changes_.pop(next)) next_manager_change_ = next;
  auto* oldest = &next_loop_change_;
  if (!*oldest || (next_manager_change_ && next_manager_change_->at < (*oldest)->at))
    oldest = &next_manager_change_;
  if (!*oldest) return false;
  change = **oldest;
  oldest->reset();
  return true;
}

}  // namespace invar
