#include "tools/cell/replay_process.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "components/compensation/compensation.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/typed_wire.hpp"
#include "core/executor/process_control.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/recording_reader.hpp"
#include "core/recording/type_book.hpp"
#include "core/recording/value_json.hpp"
#include "tools/cell/load_cell.hpp"

namespace invar::tools {

namespace {

using Bytes = std::vector<std::uint8_t>;

/// Where two values of one type differ first, as the path of a field; empty: nowhere.
std::string difference(const nlohmann::ordered_json& recorded, const nlohmann::ordered_json& came,
                       const std::string& path) {
  if (recorded == came) return "";
  if (recorded.is_object() && came.is_object())
    for (const auto& [key, value] : recorded.items())
      if (auto found = difference(value, came[key], path.empty() ? key : path + "." + key); !found.empty())
        return found;
  return path + ": " + recorded.dump() + " was recorded, " + came.dump() + " came out";
}

/// One output: what it writes now waits here until the recording says what it wrote then.
struct Watched {
  ReplayedTopic result;
  const recording::BuiltInType* type = nullptr;
  std::deque<Bytes> came;
  std::deque<std::pair<Instant, Bytes>> recorded;

  void compare() {
    while (!came.empty() && !recorded.empty()) {
      judge(recorded.front().first, recorded.front().second, came.front());
      came.pop_front();
      recorded.pop_front();
    }
  }
  void judge(Instant at, const Bytes& then, const Bytes& now) {
    ++result.recorded;
    if (then == now) {
      ++result.equal;
      return;
    }
    // Bytes between the fields may differ; only values count.
    std::string why = "bytes differ";
    if (type != nullptr) {
      const auto a = recording::decode(*type->type, {then.data(), then.size()});
      const auto b = recording::decode(*type->type, {now.data(), now.size()});
      if (a.ok() && b.ok())
        why = difference(recording::to_json(a.value()), recording::to_json(b.value()), "");
    }
    if (why.empty())
      ++result.equal;
    else
      differ(at, why);
  }
  void differ(Instant at, const std::string& why) {
    if (result.first_ns >= 0) return;
    result.first_ns = at.ns;
    result.first_difference = why;
  }
  /// What was recorded and did not come again.
  void end() {
    compare();
    for (const auto& [at, bytes] : recorded) {
      ++result.recorded;
      differ(at, "was recorded, but did not come out");
    }
  }
};

class Replayed {
 public:
  explicit Replayed(LoadedProcess& process)
      : file_{*process.file}, executor_{executor_options(file_, true)}, control_{executor_} {
    for (LoadedComponent& member : process.components) {
      member.component->simulated_time = true;
      // What was kept since is not what the recording began with.
      if (auto* found = dynamic_cast<compensation::Compensation*>(member.component.get()))
        found->keep_nothing();
      executor_.add(std::move(member.component), {.type = member.file->type,
                                                  .parameters = std::move(member.prepared.infos),
                                                  .storage = member.prepared.parameters,
                                                  .every = static_cast<std::uint32_t>(member.file->every)});
    }
    std::set<std::string> written;
    each_port([&](std::size_t index, Port& port) {
      if (port.direction() != Port::Direction::output) return;
      written.insert(port.topic);
      each_port([&](std::size_t, Port& input) {
        if (input.direction() == Port::Direction::input && input.topic == port.topic)
          static_cast<OutputPort&>(port).connect(static_cast<InputPort&>(input));
      });
      watch(index, static_cast<OutputPort&>(port));
    });
    each_port([&](std::size_t, Port& port) {
      if (port.direction() == Port::Direction::inbox ||
          (port.direction() == Port::Direction::input && !written.contains(port.topic)))
        inputs_[port.topic].push_back(wire_type(port).attach(static_cast<InputPort&>(port), false));
    });
  }

  ReplayReport run(const recording::Recording& file, const std::function<bool()>& stop) {
    ReplayReport report;
    for (const Transition transition : {Transition::configure, Transition::activate}) {
      const Outcome outcome = control_.request("", transition);
      if (outcome.ok()) continue;
      report.failure = "cannot " + std::string{to_text(transition)} + ": " + outcome.reason;
      return report;
    }
    up_ = true;  // what was written before the first window went nowhere then either
    std::set<std::string> fed;
    auto messages = file.messages();
    while (const auto message = messages.next()) {
      if (stop()) break;
      // What was delivered at the start of a window is there before the cycles of that window run.
      if (message->log_time > executor_.now()) executor_.advance_to(message->log_time);
      feed(*message, fed, report);
      if (const auto found = watched_.find(message->channel->topic); found != watched_.end()) {
        found->second.recorded.emplace_back(message->log_time,
                                            Bytes{message->data.begin(), message->data.end()});
        found->second.compare();
      }
    }
    report.simulated_seconds = executor_.now().in_seconds();
    control_.stop();
    for (const auto& [topic, ports] : inputs_)
      if (!fed.contains(topic)) report.absent_inputs.push_back(topic);
    for (auto& [topic, output] : watched_) {
      output.end();
      report.outputs.push_back(output.result);
    }
    return report;
  }

 private:
  template <class Visit>
  void each_port(Visit visit) {
    for (std::size_t i = 0; i < executor_.size(); ++i)
      for (Port* port : executor_.component(i).ports())
        if (!port->topic.empty()) visit(i, *port);
  }

  static const dds::WireType& wire_type(const Port& port) {
    const auto* type = dds::WireTypes::all().find(port.type());
    if (type == nullptr)
      throw InputError{"topic `" + port.topic + "`", "carries a type that no IDL describes",
                       "add it to idl/"};
    return *type;
  }

  /// Takes what the process would have sent: as often as `publish` allows.
  void watch(std::size_t component, OutputPort& port) {
    const auto& rates = file_.components[component].publish_rates;
    const auto rate = rates.find(port.name());
    const Duration separation = rate == rates.end() ? Duration{} : Duration::seconds(1.0 / rate->second);
    const auto& type = wire_type(port);
    Watched& watched = watched_[port.topic];
    watched.result.topic = port.topic;
    watched.type = recording::built_in_type(type.name());
    type.attach_cdr(
        port,
        [this, &port, thinning = dds::Thinning{separation}]() mutable {
          return up_ && thinning.passes(port.owner().now());
        },
        [&watched](std::span<const std::byte> cdr) {
          const auto* bytes = reinterpret_cast<const std::uint8_t*>(cdr.data());
          watched.came.emplace_back(bytes, bytes + cdr.size());
        });
  }

  void feed(const recording::RecordedMessage& message, std::set<std::string>& fed, ReplayReport& report) {
    const auto found = inputs_.find(message.channel->topic);
    if (found == inputs_.end()) return;
    fed.insert(message.channel->topic);
    const std::span cdr{reinterpret_cast<const std::byte*>(message.data.data()), message.data.size()};
    for (const auto& inlet : found->second)
      if (inlet->deliver(cdr, message.log_time) == dds::Inlet::Delivery::taken) ++report.fed;
  }

  const config::CellProcess& file_;
  Executor executor_;
  ProcessControl control_;
  bool up_ = false;
  std::map<std::string, Watched> watched_;
  std::map<std::string, std::vector<std::unique_ptr<dds::Inlet>>> inputs_;
};

}  // namespace

ReplayReport replay_process(const std::filesystem::path& cell, const std::string& process,
                            const std::filesystem::path& recording, const std::function<bool()>& stop) {
  LoadedCell loaded = load_cell(cell);
  LoadedProcess* found = loaded.process(process);
  if (found == nullptr)
    throw InputError{cell.string(), "`" + process + "` is no process of this cell",
                     config::mend_name(process, loaded.process_names())};
  const auto file = recording::Recording::open(recording);
  // Simulated time begins at 0; what is years away was stamped by UTC.
  if (file.statistics().start > Instant{} + Duration::seconds(1e8))
    throw InputError{recording.string(),
                     "was recorded in real time; only a run in simulated time can be run again",
                     "record the cell with `time: simulated`, or replay without --into"};
  return Replayed{*found}.run(file, stop);
}

}  // namespace invar::tools
