#include "core/executor/process_control.hpp"

#include <algorithm>

#include "core/base/unit.hpp"
#include "core/config/yaml.hpp"

namespace invar {

namespace {

/// Whether a request to all leaves a component in this state alone.
bool is_beyond(LifecycleState state, Transition transition) {
  using enum LifecycleState;
  switch (transition) {
    case Transition::configure:
      return state == active;
    case Transition::deactivate:
      return state == unconfigured || state == error || state == finalized;
    case Transition::cleanup:
      return state == error || state == finalized;
    case Transition::reset:
      return state != error;
    case Transition::activate:
    case Transition::shutdown:
      return false;
  }
  return false;
}

std::uint64_t lost_by(const Component& component) {
  std::uint64_t sum = 0;
  for (const Port* port : component.ports())
    if (const auto* input = dynamic_cast<const InputPort*>(port)) sum += input->lost();
  return sum;
}

}  // namespace

ComponentStatus ProcessControl::component(std::size_t index) const {
  const Executor& executor = executor_;
  return {executor.component(index).name,
          executor.type(index),
          executor.state(index),
          executor.failure(index),
          executor.every(index),
          executor.steps(index),
          lost_by(executor.component(index)),
          executor.compute(index).percentiles(),
          executor.ages(index)};
}

ProcessStatus ProcessControl::status() const {
  ProcessStatus status;
  status.process = executor_.options().process;
  status.simulated = executor_.options().simulated;
  status.running = executor_.is_running();
  status.period = executor_.options().period;
  status.overrun = executor_.options().overrun;
  status.counters = executor_.counters();
  status.wake_up = executor_.wake_up().percentiles();
  status.compute = executor_.compute().percentiles();
  if (const auto& asked = executor_.options().real_time) status.latency_limit = asked->latency;
  status.latency = executor_.latency().percentiles();
  status.trip_reason = executor_.trip_reason();
  if (status.running) status.not_granted = refusals(executor_.grants());
  for (std::size_t i = 0; i < executor_.size(); ++i) status.components.push_back(component(i));
  return status;
}

std::string ProcessControl::unknown(std::string_view component) const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < executor_.size(); ++i) names.push_back(executor_.component(i).name);
  const std::string near = config::nearest(component, names);
  return "no component `" + std::string{component} + "` in process " + executor_.options().process +
         (near.empty() ? "" : "; did you mean `" + near + "`?");
}

Outcome ProcessControl::request(std::string_view component, Transition transition, std::uint64_t id) {
  const std::lock_guard turn{turn_};
  if (component.empty()) component = "all";
  if (auto earlier = log_.find(id, component, transition)) return *earlier;
  Outcome outcome;
  if (component == "all") {
    outcome = request_all(transition);
  } else if (const auto index = executor_.find(component)) {
    outcome = executor_.transition(*index, transition);
  } else {
    outcome.reason = unknown(component);
  }
  outcome.request = id;
  log_.remember(component, transition, outcome);
  return outcome;
}

Outcome ProcessControl::request_all(Transition transition) {
  const bool upwards = transition == Transition::configure || transition == Transition::activate;
  auto order = executor_.bring_up_order();
  if (!upwards) std::reverse(order.begin(), order.end());
  if (transition == Transition::reset) executor_.clear_trip();
  if (transition == Transition::deactivate || transition == Transition::shutdown) executor_.wind_down_all();
  Outcome all{0, Verdict::already, decide(LifecycleState::unconfigured, transition).target, ""};
  if (transition == Transition::activate) all.state = LifecycleState::active;
  if (transition == Transition::deactivate) all.state = LifecycleState::inactive;
  for (const std::size_t index : order) {
    if (is_beyond(executor_.state(index), transition)) continue;
    const Outcome one = executor_.transition(index, transition);
    if (one.ok()) {
      if (all.ok() && one.verdict == Verdict::done) all.verdict = Verdict::done;
      continue;
    }
    if (all.ok()) {
      all = one;
      all.reason = executor_.component(index).name + ": " + one.reason;
    }
    if (upwards) break;
  }
  return all;
}

std::vector<ParameterStatus> ProcessControl::parameters(std::string_view component) const {
  std::vector<ParameterStatus> list;
  const auto index = executor_.find(component);
  if (!index) return list;
  for (const ParameterInfo& info : executor_.parameters(*index))
    list.push_back({info, executor_.parameter(*index, info.path)});
  return list;
}

std::string ProcessControl::set_parameter(std::string_view component, std::string_view path, double value,
                                          std::string_view unit) {
  const auto index = executor_.find(component);
  if (!index) return unknown(component);
  if (!unit.empty()) {
    for (const ParameterInfo& info : executor_.parameters(*index)) {
      if (info.path != path) continue;
      const auto convert = conversion(unit, info.unit);
      if (!convert)
        return std::string{component} + "." + info.path + ": `" + std::string{unit} +
               "` is no unit of it; give " + (info.unit.empty() ? "a number without unit" : info.unit);
      value = (*convert)(value);
    }
  }
  return executor_.set_parameter(*index, path, value);
}

void ProcessControl::stop() {
  if (executor_.options().simulated) executor_.request_stop();  // its clock is over: nobody steps any more
  (void)request("all", Transition::shutdown);
  executor_.stop();
}

}  // namespace invar
