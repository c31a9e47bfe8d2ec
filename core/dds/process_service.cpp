#include "core/dds/process_service.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <utility>

#include "core/base/clock.hpp"
#include "core/base/shown.hpp"
#include "core/component/standby.hpp"
#include "core/dds/clock_offset.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/simulated_clock.hpp"

namespace invar::dds {

namespace {

constexpr std::size_t most_waiting = 1000;  // requests: a flood takes no more memory
constexpr Duration between_told = Duration::seconds(5.0);

lifecycle::Percentiles on_wire(const Percentiles& p) {
  lifecycle::Percentiles out;
  out.p50_ns(p.p50.ns);
  out.p99_ns(p.p99.ns);
  out.p999_ns(p.p999.ns);
  out.max_ns(p.max.ns);
  return out;
}

lifecycle::ComponentState on_wire(LifecycleState state) {
  return static_cast<lifecycle::ComponentState>(state);
}

/// Nothing: stop the process.
std::optional<Transition> from_wire(lifecycle::Transition transition) {
  switch (transition) {
    case lifecycle::TRANSITION_CONFIGURE:
      return Transition::configure;
    case lifecycle::TRANSITION_ACTIVATE:
      return Transition::activate;
    case lifecycle::TRANSITION_DEACTIVATE:
      return Transition::deactivate;
    case lifecycle::TRANSITION_CLEANUP:
      return Transition::cleanup;
    case lifecycle::TRANSITION_RESET:
      return Transition::reset;
    case lifecycle::TRANSITION_SHUTDOWN:
      return Transition::shutdown;
    case lifecycle::TRANSITION_STOP_PROCESS:
      break;
  }
  return std::nullopt;
}

lifecycle::Parameter on_wire(const std::string& component, const ParameterStatus& status) {
  lifecycle::Parameter out;
  out.component_name(component);
  out.path(status.info.path);
  out.kind(status.info.type);
  out.unit_text(status.info.unit);
  out.value(status.value ? shown(*status.value, 12) : status.info.otherwise);
  const Range& range = status.info.range;
  if (std::isfinite(range.lower) || std::isfinite(range.upper))
    out.bounds("[" + shown(range.lower, 12) + ", " + shown(range.upper, 12) + "]");
  out.description(status.info.description);
  out.changeable(status.info.changeable);
  return out;
}

std::uint32_t own_endpoints(const Node& node) {
  const Snapshot snapshot = node.snapshot();
  return static_cast<std::uint32_t>(std::count_if(snapshot.endpoints.begin(), snapshot.endpoints.end(),
                                                  [](const Endpoint& end) { return end.is_local; }));
}

std::string one_line(const std::vector<std::string>& lines) {
  std::string text;
  for (const auto& line : lines) text += (text.empty() ? "" : "; ") + line;
  return text;
}

}  // namespace

ProcessService::ProcessService(Node& node, ProcessControl& control, Options options)
    : node_{node},
      control_{control},
      options_{std::move(options)},
      number_{name_number(node.options().process)},
      process_{
          node.writer<lifecycle::ProcessStatus>(ServiceTopics{node.options().cell}.process_status, "state")},
      component_{node.writer<lifecycle::ComponentStatus>(ServiceTopics{node.options().cell}.component_status,
                                                         "state")},
      notice_{node.writer<event::Notice>(ServiceTopics{node.options().cell}.notices, "event")},
      lifecycle_{node.writer<lifecycle::LifecycleReply>(ServiceTopics{node.options().cell}.lifecycle_reply,
                                                        "request")},
      parameter_{node.writer<lifecycle::ParameterReply>(ServiceTopics{node.options().cell}.parameter_reply,
                                                        "request")},
      model_{node.writer<transfer::ModelReply>(ServiceTopics{node.options().cell}.model_reply, "request")},
      models_{options_.models} {
  const ServiceTopics topics{node.options().cell};
  const auto take = [this](const auto& request, Instant sent) {
    if (request.process_id() == number_) enqueue({request, age_by_nearer_clock(sent)});
  };
  const Profile& qos = node.profile("request");
  readers_.push_back(node.timed_reader<lifecycle::LifecycleRequest>(topics.lifecycle_request, qos, take));
  readers_.push_back(node.timed_reader<lifecycle::ParameterRequest>(topics.parameter_request, qos, take));
  readers_.push_back(node.timed_reader<transfer::ModelRequest>(topics.model_request, qos, take));
}

void ProcessService::start() {
  thread_ = std::thread{[this] { run(); }};
}

ProcessService::~ProcessService() {
  readers_.clear();
  {
    const std::lock_guard lock{mutex_};
    stopping_ = true;
  }
  news_.notify_all();
  if (thread_.joinable()) thread_.join();
  publish_news();
  publish_status();
}

void ProcessService::enqueue(Request request) {
  const std::lock_guard lock{mutex_};
  if (requests_.size() == most_waiting) requests_.pop_front();  // its client asks again
  requests_.push_back(std::move(request));
  news_.notify_all();
}

void ProcessService::run() {
  auto next = std::chrono::steady_clock::now();
  for (;;) {
    std::unique_lock lock{mutex_};
    news_.wait_for(lock, std::chrono::milliseconds{50}, [this] { return stopping_ || !requests_.empty(); });
    if (stopping_) return;
    std::deque<Request> requests;
    requests.swap(requests_);
    lock.unlock();
    for (const auto& request : requests)
      std::visit([&](const auto& message) { serve(message, request.age); }, request.message);
    publish_news();
    if (std::chrono::steady_clock::now() >= next || !requests.empty()) {
      follow_clock();
      publish_late(control_.status());
      publish_status();
      next = std::chrono::steady_clock::now() + std::chrono::nanoseconds{options_.interval.ns};
    }
  }
}

base::Stamp ProcessService::stamp() const {
  base::Stamp at;
  const LoopCounters counters = control_.executor().counters();
  at.cycle(counters.cycle);
  at.time_ns(control_.executor().now().ns);
  return at;
}

/// The samples' clock follows the host's, and whoever compares stamps of two hosts hears when it is not there yet.
void ProcessService::follow_clock() {
  if (control_.executor().options().simulated) return;
  const Duration ahead = follow_utc();
  const bool apart = ahead > Duration::milliseconds(1) || ahead < Duration::milliseconds(-1);
  if (apart && !told_apart_) {
    std::ostringstream text;
    text << "somebody set the clock of this host by " << ahead.in_seconds()
         << " s; the stamps follow by 0.5 ms a second: restart the process to have them right at once";
    publish(event::SEVERITY_WARNING, node_.options().process, text.str());
  }
  told_apart_ = apart;
}

void ProcessService::publish(event::Severity level, const std::string& source, const std::string& text) {
  event::Notice notice;
  notice.cell(options_.cell);
  notice.component_id(number_);
  notice.at(stamp());
  notice.level(level);
  notice.source(source);
  notice.text(text);
  if (options_.on_notice) options_.on_notice(notice);
  notice_.write(notice);
}

void ProcessService::publish_news() {
  for (const auto& alarm : node_.take_alarms())
    publish(alarm.fault ? event::SEVERITY_FAULT : event::SEVERITY_WARNING, node_.options().process,
            alarm.topic + ": " + alarm.text);
  for (StateChange change; control_.executor().take_change(change);) {
    const std::string name = control_.executor().component(change.component).name;
    const bool failed = change.to == LifecycleState::error;
    std::string text{to_text(change.from)};
    const std::string why = change.why.data();
    text += " -> " + std::string{to_text(change.to)} + (why.empty() ? "" : ": " + why);
    publish(failed        ? event::SEVERITY_FAULT
            : why.empty() ? event::SEVERITY_NOTE
                          : event::SEVERITY_WARNING,
            name, text);
  }
}

/// What of the declared latencies was not kept since the last look, one notice each.
void ProcessService::publish_late(const ProcessStatus& status) {
  const auto say = [&](const std::string& source, const std::string& key, std::uint64_t count,
                       const std::string& what) {
    const std::uint64_t before = std::exchange(told_late_[key], count);
    if (count > before && control_.executor().options().late != LatePolicy::mark)
      publish(event::SEVERITY_WARNING, source, std::to_string(count - before) + what);
  };
  if (status.latency_limit)
    say(node_.options().process, "", status.counters.late,
        " cycles ended later than the declared latency of " + milliseconds(*status.latency_limit, 3) +
            " allows; the latest so far after " + milliseconds(status.latency.max, 3));
  for (const ComponentStatus& component : status.components)
    for (const InputAge& input : component.ages)
      say(component.name, component.name + "." + input.port, input.late,
          " steps read a sample of `" + input.port + "` older than the declared latency of " +
              milliseconds(input.limit, 3) + "; the oldest so far was of " + milliseconds(input.age.max, 3));
}

Standby* ProcessService::standby_of(std::size_t component) const {
  return options_.standby_of ? options_.standby_of(component) : nullptr;
}

/// How far the clock of this host is ahead of that of the reference, where both are measured.
void ProcessService::tell_clock(lifecycle::ProcessStatus& process) const {
  const ClockReading own = ClockReading::now();
  process.stamps_behind_ns(process.simulated() ? 0 : (own.system - own.stamps).ns);
  process.clock_error_ns(-1);
  const HostClocks* clocks = node_.clocks();
  if (clocks == nullptr) return;
  process.clock_reference(options_.clock_reference);
  if (options_.clock_reference == clocks->host()) process.clock_error_ns(0);
  for (const HostClock& other : clocks->hosts(own.monotonic))
    if (other.host == options_.clock_reference) {
      process.clock_ahead_ns(-other.ahead.ns);
      process.clock_error_ns(other.error.ns);
    }
}

void ProcessService::publish_status() {
  const std::lock_guard turn{status_turn_};
  const ProcessStatus status = control_.status();
  const Recent recent = recent_.look(control_.executor(), monotonic_now());
  lifecycle::ProcessStatus process;
  process.cell(options_.cell);
  process.process_id(number_);
  process.at(stamp());
  process.process_name(node_.options().process);
  process.host(options_.host);
  process.pid(static_cast<std::uint32_t>(getpid()));
  process.realtime_asked(control_.executor().options().real_time.has_value());
  process.realtime_granted(process.realtime_asked() && status.not_granted.empty());
  process.realtime_text(one_line(status.not_granted));
  process.simulated(status.simulated);
  process.rate(1.0 / status.period.in_seconds());
  process.cycles(status.counters.executed);
  process.overruns(status.counters.overruns);
  process.skipped(status.counters.skipped);
  process.trip_reason(status.trip_reason);
  process.wake_up(on_wire(status.wake_up));
  process.compute(on_wire(status.compute));
  process.latency(on_wire(status.latency));
  process.latency_limit_ns(status.latency_limit ? status.latency_limit->ns : 0);
  process.late(status.counters.late);
  process.lost(node_.lost());
  process.endpoints(own_endpoints(node_));
  process.restarts(options_.restarts);
  process.last_end(options_.last_end);
  process.window_ns(recent.window.ns);
  process.recent_wake_up(on_wire(recent.wake_up));
  process.recent_compute(on_wire(recent.compute));
  process.recent_latency(on_wire(recent.latency));
  tell_clock(process);
  process_.write(process);

  for (std::size_t i = 0; i < status.components.size(); ++i) {
    const auto& from = status.components[i];
    lifecycle::ComponentStatus out;
    out.cell(options_.cell);
    out.component_id(options_.id_of ? options_.id_of(i) : control_.executor().component(i).id);
    out.at(process.at());
    out.component_name(from.name);
    out.component_type(from.type);
    out.process_name(node_.options().process);
    out.state(on_wire(from.state));
    out.failure(from.failure);
    out.steps(from.steps);
    out.lost(from.lost);
    out.every(from.every);
    out.compute(on_wire(from.compute));
    for (const InputAge& input : from.ages) {
      lifecycle::InputAge age;
      age.port(input.port);
      age.limit_ns(input.limit.ns);
      age.late(input.late);
      age.age(on_wire(input.age));
      out.inputs().push_back(age);
    }
    if (options_.fault_of) out.fault(options_.fault_of(i));
    if (const Standby* standby = standby_of(i); standby != nullptr) out.role(standby->role());
    out.recent_compute(on_wire(recent.steps[i]));
    component_.write(out);
  }
}

/// Replies carry no lifespan at their reader, so that whoever asks hears what became of it whatever its clock says.
std::string ProcessService::too_late(Duration age) const {
  const Duration lifespan = node_.profile("request").lifespan;
  if (lifespan.ns <= 0 || age <= lifespan) return {};
  return "not carried out: the request was sent " + seconds_text(age) + " before it arrived, by its clock; " +
         clocks_apart("the PC that asks", Duration{} - age,
                      "the PC of process `" + node_.options().process + "`");
}

void ProcessService::tell_clocks(Duration age) {
  const Duration lifespan = node_.profile("request").lifespan;
  const Instant now = monotonic_now();
  if (lifespan.ns <= 0 || age >= -lifespan || (told_clocks_ && now - *told_clocks_ < between_told)) return;
  told_clocks_ = now;
  publish(event::SEVERITY_WARNING, node_.options().process,
          "a request was sent in the future and is carried out; " +
              clocks_apart("the PC that asks", Duration{} - age, "this one"));
}

void ProcessService::serve(const lifecycle::LifecycleRequest& request, Duration age) {
  lifecycle::LifecycleReply reply;
  reply.client(request.client());
  reply.process_id(number_);
  reply.request(request.request());
  tell_clocks(age);
  if (const std::string why = too_late(age); !why.empty()) {
    reply.text(why);
  } else if (const auto transition = from_wire(request.wanted())) {
    // Repeated requests are known by their id and not carried out again.
    const std::uint64_t id = request.client() ^ (request.request() * 0x9E3779B97F4A7C15U);
    const std::string component = request.component_name().c_str();
    const Outcome outcome = control_.request(component, *transition, id);
    // To activate the one that stands by has it lead.
    if (const auto index = control_.executor().find(component);
        index && *transition == Transition::activate && outcome.verdict == Verdict::already)
      if (Standby* standby = standby_of(*index); standby != nullptr) (void)standby->ask();
    reply.done(outcome.ok());
    reply.state(on_wire(outcome.state));
    reply.text(outcome.reason);
  } else if (options_.stop_process) {
    reply.done(true);
    reply.state(lifecycle::STATE_FINALIZED);
    options_.stop_process();
  } else {
    reply.text("this process is not stopped by request");
  }
  reply.at(stamp());
  lifecycle_.write(reply);
}

void ProcessService::serve(const lifecycle::ParameterRequest& request, Duration age) {
  for (const auto& known : answered_)
    if (known.client() == request.client() && known.request() == request.request()) {
      parameter_.write(known);
      return;
    }
  tell_clocks(age);
  const bool sets = request.action() == lifecycle::PARAMETER_SET;
  const std::string why = sets ? too_late(age) : "";  // to look harms nobody
  lifecycle::ParameterReply reply;
  if (why.empty())
    reply = answer(request);
  else
    reply.text(why);
  reply.client(request.client());
  reply.process_id(number_);
  reply.request(request.request());
  reply.at(stamp());
  parameter_.write(reply);
  if (!sets || !why.empty()) return;
  answered_.push_back(std::move(reply));
  if (answered_.size() > 64) answered_.pop_front();
}

/// To keep the same text twice is to keep it once, so that a request that comes again needs no memory.
void ProcessService::serve(const transfer::ModelRequest& request, Duration age) {
  transfer::ModelReply reply;
  reply.client(request.client());
  reply.process_id(number_);
  reply.request(request.request());
  std::string why = too_late(age);
  if (why.empty() && !control_.executor().find(request.component_name().c_str()))
    why = "process `" + node_.options().process + "` has no such component";
  if (why.empty()) {
    const ReceivedModels::Kept kept = models_.keep(request.text());
    reply.path(kept.file.string());
    why = kept.refusal;
  }
  reply.done(why.empty());
  reply.text(why);
  reply.at(stamp());
  model_.write(reply);
}

lifecycle::ParameterReply ProcessService::answer(const lifecycle::ParameterRequest& request) {
  lifecycle::ParameterReply reply;
  const std::string component = request.component_name().c_str();
  const std::string path = request.path().c_str();
  if (!component.empty() && !control_.executor().find(component)) {
    reply.text("process `" + node_.options().process + "` has no component `" + component + "`");
    return reply;
  }
  if (request.action() == lifecycle::PARAMETER_SET) {
    const std::string text = request.value().c_str();
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (end == text.c_str()) {
      reply.text("`" + text + "` is no number");
      return reply;
    }
    std::string unit{end};
    unit.erase(0, unit.find_first_not_of(' '));
    const std::string why = control_.set_parameter(component, path, value, unit);
    if (!why.empty()) {
      reply.text(why);
      return reply;
    }
  }
  for (std::size_t i = 0; i < control_.executor().size(); ++i) {
    const std::string& name = control_.executor().component(i).name;
    if (!component.empty() && name != component) continue;
    for (const auto& parameter : control_.parameters(name))
      if ((path.empty() || parameter.info.path == path) && reply.parameters().size() < 512)
        reply.parameters().push_back(on_wire(name, parameter));
  }
  reply.done(!reply.parameters().empty() || path.empty());
  if (!reply.done()) reply.text("`" + component + "` has no parameter `" + path + "`");
  return reply;
}

}  // namespace invar::dds
