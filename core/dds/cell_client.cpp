#include "core/dds/cell_client.hpp"

#include <algorithm>
#include <chrono>
#include <random>

#include "core/dds/clock_offset.hpp"
#include "core/dds/simulated_clock.hpp"

namespace invar::dds {

namespace {
constexpr std::size_t notices_kept = 5000;

ServiceTopics topics_of(const Node& node, const std::string& cell) {
  return ServiceTopics{cell.empty() ? node.options().cell : cell};
}
}  // namespace

ServiceTopics::ServiceTopics(const std::string& cell) {
  const std::string base = "cell/" + cell + "/process/";
  process_status = base + "status";
  component_status = base + "components";
  notices = base + "notices";
  lifecycle_request = base + "lifecycle_request";
  lifecycle_reply = base + "lifecycle_reply";
  parameter_request = base + "parameter_request";
  parameter_reply = base + "parameter_reply";
  model_request = base + "model_request";
  model_reply = base + "model_reply";
}

CellClient::CellClient(Node& node, const std::string& cell)
    : client_{(std::uint64_t{std::random_device{}()} << 32U) | std::random_device{}()},
      lifecycle_{node, topics_of(node, cell).lifecycle_request},
      parameter_{node, topics_of(node, cell).parameter_request},
      model_{node, topics_of(node, cell).model_request} {
  const ServiceTopics topics = topics_of(node, cell);
  readers_.push_back(listen(node, topics.lifecycle_reply, lifecycle_replies_));
  readers_.push_back(listen(node, topics.parameter_reply, parameter_replies_));
  readers_.push_back(listen(node, topics.model_reply, model_replies_));
  readers_.push_back(node.timed_reader<lifecycle::ProcessStatus>(
      topics.process_status, node.profile("state"), [this](const auto& status, Instant sent) {
        const std::lock_guard lock{mutex_};
        const std::string process = status.process_name().c_str();
        lifecycle::ProcessStatus& known = processes_[process];
        // Who says in its place that it ended keeps that for late comers: the process may live again.
        if (status.pid() == 0 && status.at().time_ns() < known.at().time_ns()) return;
        known = status;
        if (status.pid() == 0) return;  // not sent by the process itself
        const Duration age = system_now() - (sent + Duration{status.stamps_behind_ns()});
        const auto [least, first] = ages_.try_emplace(process, age);
        least->second = std::min(least->second, age);
      }));
  readers_.push_back(
      node.reader<lifecycle::ComponentStatus>(topics.component_status, "state", [this](const auto& status) {
        const std::lock_guard lock{mutex_};
        components_[status.component_name().c_str()] = status;
      }));
  readers_.push_back(node.reader<event::Notice>(topics.notices, "event", [this](const auto& notice) {
    const std::lock_guard lock{mutex_};
    if (notices_.size() == notices_kept) notices_.pop_front();
    notices_.push_back(notice);
  }));
}

template <class Request>
CellClient::Asking<Request>::Asking(Node& node, std::string topic) : node_{node}, topic_{std::move(topic)} {
  const auto& identity = node.options().identity;
  if (!identity || identity->may_command) (void)writer();
}

template <class Request>
Writer<Request>& CellClient::Asking<Request>::writer() {
  const std::lock_guard lock{mutex_};
  if (!writer_) writer_ = std::make_unique<Writer<Request>>(node_.writer<Request>(topic_, "request"));
  return *writer_;
}

template <class Reply>
std::unique_ptr<Connection> CellClient::listen(Node& node, const std::string& topic,
                                               std::map<std::uint64_t, Reply>& replies) {
  return node.reader<Reply>(topic, "request", [this, &replies](const Reply& reply) {
    if (reply.client() != client_) return;
    const std::lock_guard lock{mutex_};
    replies[reply.request()] = reply;
    news_.notify_all();
  });
}

template <class Request, class Reply>
std::optional<Reply> CellClient::call(Asking<Request>& asking, std::map<std::uint64_t, Reply>& replies,
                                      Request request, const std::string& process, Duration patience,
                                      Duration interval) {
  Writer<Request>& writer = asking.writer();
  std::unique_lock lock{mutex_};
  request.client(client_);
  request.request(++requests_);
  request.process_id(name_number(process));
  const auto end = std::chrono::steady_clock::now() + std::chrono::nanoseconds{patience.ns};
  while (std::chrono::steady_clock::now() < end) {
    lock.unlock();
    writer.write(request);  // again, where the process was not yet connected or its reply went astray
    lock.lock();
    const auto has_reply = [&] { return replies.contains(request.request()); };
    if (news_.wait_for(lock, std::chrono::nanoseconds{interval.ns}, has_reply)) {
      auto reply = replies.extract(request.request());
      return std::move(reply.mapped());
    }
  }
  return std::nullopt;
}

std::optional<lifecycle::LifecycleReply> CellClient::request(const std::string& process,
                                                             const std::string& component,
                                                             lifecycle::Transition wanted,
                                                             Duration patience) {
  lifecycle::LifecycleRequest request;
  request.component_name(component);
  request.wanted(wanted);
  return call(lifecycle_, lifecycle_replies_, std::move(request), process, patience);
}

std::optional<lifecycle::ParameterReply> CellClient::parameter(const std::string& process,
                                                               const std::string& component,
                                                               lifecycle::ParameterAction action,
                                                               const std::string& path,
                                                               const std::string& value, Duration patience) {
  lifecycle::ParameterRequest request;
  request.component_name(component);
  request.action(action);
  request.path(path);
  request.value(value);
  return call(parameter_, parameter_replies_, std::move(request), process, patience);
}

std::optional<transfer::ModelReply> CellClient::model(const std::string& process,
                                                      const std::string& component, const std::string& text,
                                                      Duration patience) {
  transfer::ModelRequest request;
  request.component_name(component);
  request.text().assign(text.begin(), text.end());
  return call(model_, model_replies_, std::move(request), process, patience, Duration::milliseconds(500));
}

std::vector<lifecycle::ProcessStatus> CellClient::processes() const {
  const std::lock_guard lock{mutex_};
  std::vector<lifecycle::ProcessStatus> out;
  for (const auto& [name, status] : processes_) out.push_back(status);
  return out;
}

std::vector<lifecycle::ComponentStatus> CellClient::components() const {
  const std::lock_guard lock{mutex_};
  std::vector<lifecycle::ComponentStatus> out;
  for (const auto& [name, status] : components_) out.push_back(status);
  return out;
}

std::vector<event::Notice> CellClient::take_notices() {
  const std::lock_guard lock{mutex_};
  std::vector<event::Notice> out{notices_.begin(), notices_.end()};
  notices_.clear();
  return out;
}

std::optional<Duration> CellClient::clock_ahead(const std::string& process) const {
  const std::lock_guard lock{mutex_};
  const auto found = ages_.find(process);
  return found == ages_.end() ? std::nullopt : std::optional{found->second};
}

std::string CellClient::clocks_apart(const std::string& process) const {
  const auto ahead = clock_ahead(process);
  // A first status may have waited for a whole interval; more than that is the clocks'.
  constexpr Duration noticed = Duration::milliseconds(1000);
  if (!ahead || (*ahead<noticed&& * ahead> - noticed)) return {};
  return dds::clocks_apart("this PC", *ahead, "the PC of process `" + process + "`");
}

std::string CellClient::process_of(const std::string& component) const {
  const std::lock_guard lock{mutex_};
  const auto found = components_.find(component);
  return found == components_.end() ? "" : found->second.process_name().c_str();
}

std::optional<lifecycle::Transition> parse_wire_transition(std::string_view text) {
  using namespace lifecycle;
  constexpr std::pair<std::string_view, Transition> words[] = {
      {"configure", TRANSITION_CONFIGURE},   {"activate", TRANSITION_ACTIVATE},
      {"deactivate", TRANSITION_DEACTIVATE}, {"cleanup", TRANSITION_CLEANUP},
      {"reset", TRANSITION_RESET},           {"shutdown", TRANSITION_SHUTDOWN},
      {"stop", TRANSITION_STOP_PROCESS}};
  for (const auto& [word, transition] : words)
    if (word == text) return transition;
  return std::nullopt;
}

}  // namespace invar::dds
