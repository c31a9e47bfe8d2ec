#include "tools/cell/process.hpp"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <chrono>
#include <deque>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>

#include "components/recorder/recorder.hpp"
#include "components/supervisor/supervisor.hpp"
#include "core/base/clock.hpp"
#include "core/component/standby.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/live_process.hpp"
#include "core/dds/node.hpp"
#include "core/dds/process_service.hpp"
#include "core/dds/segment_size.hpp"
#include "core/dds/simulated_clock.hpp"
#include "core/dds/wire_type.hpp"
#include "core/executor/locked_memory.hpp"
#include "core/executor/process_control.hpp"
#include "core/job/job_component.hpp"
#include "core/recording/type_book.hpp"
#include "idl/stage.h"
#include "tools/cell/black_box_file.hpp"
#include "tools/cell/component_faults.hpp"
#include "tools/cell/job_follower.hpp"
#include "tools/cell/last_words.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/node_courier.hpp"
#include "tools/cell/notice_log.hpp"
#include "tools/cell/own_host.hpp"
#include "tools/cell/process_claim.hpp"
#include "tools/cell/service_manager.hpp"
#include "tools/cell/standbys.hpp"

namespace invar::tools {

namespace {

std::vector<std::type_index> outputs_of(const LoadedProcess& process) {
  std::vector<std::type_index> types;
  for (const LoadedComponent& member : process.components)
    for (const Port* port : member.component->ports())
      if (port->direction() == Port::Direction::output) types.push_back(port->type());
  return types;
}

bool asks_others(const LoadedProcess& process) {
  return std::any_of(process.components.begin(), process.components.end(), [](const LoadedComponent& member) {
    return dynamic_cast<const supervisor::Supervisor*>(member.component.get()) != nullptr;
  });
}

dds::NodeOptions node_options(const LoadedCell& loaded, const LoadedProcess& of, bool simulated) {
  const config::CellProcess& process = *of.file;
  dds::NodeOptions options = node_on(*loaded.cell, process.name, process.host);
  options.processes =
      static_cast<std::size_t>(std::count_if(loaded.cell->processes.begin(), loaded.cell->processes.end(),
                                             [&](const auto& other) { return other.host == process.host; }));
  if (options.identity) options.identity->may_command = asks_others(of);
  if (!simulated) options.clocks = clocks_on(*loaded.cell, process.host);
  if (process.realtime) {
    options.realtime_priority = std::max(0, process.realtime->priority - 10);
    options.realtime_cpu = process.realtime->cpu;  // samples leave the moment the loop sleeps
  }
  // In simulated time samples travel in bundles, those of a window in one.
  if (!simulated) options.segment_size = dds::segment_size_for(outputs_of(of));
  return options;
}

/// Where models go that `invar job apply` sends, beside the black boxes.
constexpr const char* received_models = "out/models";

/// Whether the loop makes no cycle any more: a step hangs. Any thread but the loop's.
class HungLoop {
 public:
  static constexpr const char* text = "its loop makes no cycle any more: a step hangs; end the process";
  bool look(const Executor& executor) {
    const std::lock_guard lock{mutex_};
    const Instant now = monotonic_now();
    const std::uint64_t cycles = executor.counters().executed;
    // A process that was stopped itself has not looked, and begins anew.
    const bool was_away = now - looked_ > Duration::seconds(1.0);
    looked_ = now;
    if (cycles != cycles_ || was_away) since_ = now;
    cycles_ = cycles;
    const Duration longest = Duration::seconds(2.0) + executor.options().period * 4;
    return executor.is_running() && now - since_ > longest;
  }

 private:
  std::mutex mutex_;
  Instant looked_, since_;
  std::uint64_t cycles_ = 0;
};

/// What one process is made of while it runs.
class RunningProcess {
 public:
  RunningProcess(const ProcessOptions& options, LoadedCell& loaded, LoadedProcess& process)
      : options_{options},
        loaded_{loaded},
        file_{*process.file},
        executor_{executor_options(file_, options.simulated)},
        control_{executor_},
        node_{node_options(loaded, process, options.simulated), dds::load_profiles(loaded.cell->profiles)} {
    CellFolders::Places models = loaded.model_places;
    models.emplace_back(received_models);
    shared_topics_ = shared_topics(loaded);
    const bool hears_of_ends = !options.simulated && has_partner_on_another_pc(loaded, file_.name);
    const auto folders = std::make_shared<const CellFolders>(std::move(models), loaded.result_places);
    for (LoadedComponent& member : process.components) {
      member.component->courier = &courier_;
      member.component->simulated_time = options.simulated;
      member.component->folders = folders;
      if (auto* found = dynamic_cast<recorder::Recorder*>(member.component.get())) recorder_ = found;
      if (auto* found = dynamic_cast<supervisor::Supervisor*>(member.component.get())) supervisor_ = found;
      if (auto* found = dynamic_cast<job::JobComponent*>(member.component.get()))
        found->refuse_while([this] {
          return node_.clocks() == nullptr ? "" : node_.clocks()->farther_than(loaded_.cell->clock_bound);
        });
      auto* redundant = dynamic_cast<Redundant*>(member.component.get());
      members_.push_back({member.file->id, redundant == nullptr ? nullptr : &redundant->standby()});
      executor_.add(std::move(member.component), {.type = member.file->type,
                                                  .parameters = std::move(member.prepared.infos),
                                                  .storage = member.prepared.parameters,
                                                  .every = static_cast<std::uint32_t>(member.file->every),
                                                  .latencies = member.file->latencies,
                                                  .check = member.prepared.check});
    }
    join_directly();
    fill_black_box();
    each_port([&](std::size_t index, Port& port) {
      faults_.watch(index, port);
      log_.follow(port);
    });
    follow_job();
    service_ = std::make_unique<dds::ProcessService>(
        node_, control_,
        dds::ProcessService::Options{
            .cell = loaded.cell->id,
            .host = file_.host,
            .models = received_models,
            .stop_process = [this] { asked_to_stop_ = true; },
            .fault_of = [this](std::size_t index) { return fault_of(index); },
            .id_of = [this](std::size_t index) { return members_.at(index).id; },
            .standby_of = [this](std::size_t index) { return members_.at(index).standby; },
            .on_notice = [this](const event::Notice& notice) { log_.write(notice); },
            .restarts = options.restarts,
            .last_end = options.last_end,
            .clock_reference = loaded.cell->hosts.front().name});
    if (supervisor_ != nullptr) supervisor_->connect(view_of_cell());
    if (hears_of_ends) hear_of_ends();
  }

  int run(const ProcessOrders& orders) {
    if (supervisor_ != nullptr) client_ = std::make_unique<dds::CellClient>(node_);
    return options_.simulated ? run_simulated(orders.stop) : run_by_the_clock(orders);
  }

 private:
  template <class Visit>
  void each_port(Visit visit) {
    for (std::size_t i = 0; i < executor_.size(); ++i)
      for (Port* port : executor_.component(i).ports())
        if (!port->topic.empty()) visit(i, *port);
  }

  /// What is wrong with a component though it is stepped.
  std::string fault_of(std::size_t index) {
    const std::string fault = hung_.look(executor_) ? HungLoop::text : faults_.of(index, executor_.now());
    const Standby* standby = members_.at(index).standby;
    if (standby == nullptr || executor_.state(index) != LifecycleState::active) return fault;
    return standby->leads() ? fault : standby->fault();
  }

  /// Of processes on other PCs, from the `invar run` that started them.
  void hear_of_ends() {
    ends_ = node_.reader<lifecycle::ProcessStatus>(
        dds::ServiceTopics{loaded_.cell->name}.process_status, "state",
        [this](const lifecycle::ProcessStatus& status) {
          if (status.pid() != 0) return;
          for (const Member& member : members_)
            if (member.standby != nullptr && member.standby->paired() &&
                member.standby->paired()->other_process == status.process_name().c_str())
              member.standby->hear_of_end(static_cast<std::int32_t>(status.ended_pid()));
        });
  }

  void look_for_others() {
    for (const Member& member : members_)
      if (member.standby != nullptr) member.standby->look_for_process(&dds::is_alive);
  }

  /// Joins signals of one process directly, but for those that another process writes when it leads. Commands (inboxes) travel by DDS, also within a process, so that every
  /// sender takes the same way.
  void join_directly() {
    each_port([&](std::size_t, Port& output) {
      if (output.direction() != Port::Direction::output || shared_topics_.contains(output.topic)) return;
      each_port([&](std::size_t, Port& input) {
        if (input.direction() == Port::Direction::input && input.topic == output.topic)
          static_cast<OutputPort&>(output).connect(static_cast<InputPort&>(input));
      });
    });
  }

  bool is_written_here(const std::string& topic) {
    if (shared_topics_.contains(topic)) return false;
    bool found = false;
    each_port([&](std::size_t, Port& port) {
      found = found || (port.direction() == Port::Direction::output && port.topic == topic);
    });
    return found;
  }

  /// What every axis did goes into the black box; an axis in fault freezes it, as a component in error does.
  void fill_black_box() {
    each_port([&](std::size_t index, Port& port) {
      auto* state = dynamic_cast<Output<stage::AxisState>*>(&port);
      if (state == nullptr) return;
      stage::AxisState& last = axes_.emplace_back();
      state->add_sink([this, &last](const stage::AxisState& sample, Instant) {
        if (sample.mode() == stage::AXIS_MODE_FAULT && last.mode() != stage::AXIS_MODE_FAULT)
          executor_.freeze_black_box();
        last = sample;
      });
      const std::string prefix = executor_.component(index).name + ".";
      BlackBox& box = executor_.black_box();
      box.watch(prefix + "setpoint_position", "m", [&last] { return last.setpoint_position(); });
      box.watch(prefix + "position", "m", [&last] { return last.position(); });
      box.watch(prefix + "following_error", "m", [&last] { return last.following_error(); });
      box.watch(prefix + "current", "A", [&last] { return last.current(); });
      box.watch(prefix + "correction", "m", [&last] { return last.correction(); });
      box.watch(prefix + "mode", "1", [&last] { return static_cast<double>(last.mode()); });
    });
    executor_.black_box().on_trip([this](const BlackBoxRecord& record) {
      try {
        say(event::SEVERITY_WARNING,
            record.reason + "; the last cycles are in " + write_black_box(record, "out").string());
      } catch (const std::exception& error) {
        say(event::SEVERITY_FAULT, std::string{"the black box cannot be written: "} + error.what());
      }
    });
  }

  /// In this process's name: into its log, and to the cell.
  void say(event::Severity level, const std::string& text) { service_->publish(level, file_.name, text); }

  /// What is wrong now, one line each.
  std::vector<std::string> faults() {
    std::vector<std::string> lines;
    const ProcessStatus status = control_.status();
    if (!status.trip_reason.empty()) lines.push_back(file_.name + ": tripped: " + status.trip_reason);
    for (std::size_t i = 0; i < status.components.size(); ++i) {
      const ComponentStatus& component = status.components[i];
      if (component.state == LifecycleState::error)
        lines.push_back(component.name + ": in error: " + component.failure);
      if (const std::string fault = fault_of(i); !fault.empty())
        lines.push_back(component.name + ": " + fault);
    }
    return lines;
  }

  void follow_job() {
    const auto found = loaded_.cell->jobs.find(options_.job);
    if (found == loaded_.cell->jobs.end()) return;
    const auto index = executor_.find(found->second);
    if (!index) return;
    try {
      job_.follow(executor_.component(*index), options_.job);
    } catch (const std::invalid_argument& error) {
      throw InputError{loaded_.cell->file.string() + ": jobs." + options_.job, error.what(),
                       "name a component with the ports `job` and `status`"};
    }
  }

  Duration separation(std::size_t component, const Port& port) const {
    const auto& rates = file_.components[component].publish_rates;
    const auto rate = rates.find(port.name());
    return rate == rates.end() ? Duration{} : Duration::seconds(1.0 / rate->second);
  }

  bool bring_up() {
    for (const Transition transition : {Transition::configure, Transition::activate}) {
      const Outcome outcome = control_.request("", transition);
      if (outcome.ok()) continue;
      spdlog::error("{}: cannot {}: {}", file_.name, to_text(transition), outcome.reason);
      return false;
    }
    job_.start();
    return true;
  }

  /// What others move on or read must be there until they rest, too: nobody leaves before it is told.
  void come_to_rest() {
    // The others of the cell come to rest now, too: what is wrong later is so because they stop.
    if (!resting_) faults_at_end_ = faults();
    if (!resting_) executor_.wind_down_all();
    resting_ = true;
    if (told_rest_ || !executor_.is_at_rest() || options_.outcome.empty()) return;
    std::ofstream{rest_file(options_.outcome)} << '\n';
    told_rest_ = true;
  }

  /// True when `invar run` is no more, which nobody could stop any more either; later, when everybody has had the time to
  /// come to rest, it is `over`.
  bool is_orphan(bool& over) {
    if (options_.outcome.empty() || getppid() == parent_) return false;
    const Instant now = monotonic_now();
    if (!orphan_since_) {
      orphan_since_ = now;
      say(event::SEVERITY_WARNING, "`invar run` is no more: coming to rest and stopping");
    }
    // Nobody says who notices first; who records leaves last, or the end of the others would be missing.
    const Duration lingers = recorder_ != nullptr ? Duration::seconds(1.0) : Duration{};
    over = now - *orphan_since_ > executor_.options().wind_down + lingers;
    return true;
  }

  int run_by_the_clock(const ProcessOrders& orders) {
    each_port([&](std::size_t index, Port& port) {
      if (port.direction() == Port::Direction::output)
        node_.bind(static_cast<OutputPort&>(port), {.period = file_.realtime ? file_.period : Duration{},
                                                    .separation = separation(index, port)});
      else if (port.direction() == Port::Direction::inbox || !is_written_here(port.topic))
        node_.bind(static_cast<InputPort&>(port));
    });
    record_topics();
    executor_.at_cycle_end([this] { node_.cycle_ended(); });
    node_.start();
    executor_.start();
    const bool up = bring_up();
    service_->publish_status();  // who waits for the cell need not wait for the next regular one
    if (up) manager_.ready();
    for (bool over = false; up && !over && !orders.stop.load() && !asked_to_stop_ && executor_.is_running() &&
                            (!job_.has_ended() || resting_);) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (const std::string refused = memory_.look(); !refused.empty()) say(event::SEVERITY_WARNING, refused);
      look_for_others();
      if (is_orphan(over) || orders.rest.load()) come_to_rest();
      manager_.feed(executor_.counters().executed);
      leave_progress();
      watch_address();
      log_.write_waiting();
    }
    take_down();
    topics_.clear();
    node_.stop();
    return up && ended_well() ? 0 : 1;
  }

  void take_down() {
    manager_.stopping();
    say_how_the_job_ended();
    status_ = control_.status();
    if (!resting_) faults_at_end_ = faults();
    control_.stop();
    log_.write_last();
    write_outcome();
    service_.reset();
  }

  /// Who started this process reads its faults in the outcome, and starts it again only where it failed itself.
  bool ended_well() {
    if (options_.launcher == 0)
      for (const std::string& line : faults_at_end_) spdlog::error("at the end: {}", line);
    return job_.is_well() && (options_.launcher != 0 || faults_at_end_.empty());
  }

  int run_simulated(const std::atomic<bool>& stop) {
    if (!options_.outcome.empty()) {
      prctl(PR_SET_PDEATHSIG, SIGTERM);  // without `invar run` time stands still
      if (getppid() != parent_) raise(SIGTERM);
    }
    dds::SimulatedClockClient clock{node_};
    each_port([&](std::size_t index, Port& port) {
      if (port.direction() == Port::Direction::output)
        clock.bind(static_cast<OutputPort&>(port), separation(index, port));
      else if (port.direction() == Port::Direction::inbox || !is_written_here(port.topic))
        clock.bind(static_cast<InputPort&>(port));
    });
    if (options_.paced) clock.listen_outside();
    if (recorder_ != nullptr)
      clock.tap([this](const dds::LockstepSample& sample) {
        if (!recorder_->is_wanted(sample.topic.topic)) return;
        recorder_->record(source(sample.topic.topic, sample.topic.type, "simulated"),
                          std::string{sample.process}, sample.sequence, sample.window, sample.window,
                          sample.cdr);
      });
    node_.start();
    const bool up = bring_up();
    if (up) manager_.ready();
    const auto outcome = clock.run(
        [&](Instant until) {
          if (!up) return std::string{"a component of `" + file_.name + "` did not come up"};
          executor_.advance_to(until);
          return std::string{};
        },
        [&] {
          manager_.feed(executor_.counters().executed);
          leave_progress();
          log_.write_waiting();
          return !options_.job.empty() && (!job_.runs() || job_.has_ended());
        },
        stop);
    if (!outcome.failure.empty()) spdlog::error("{}: {}", file_.name, outcome.failure);
    take_down();
    node_.stop();
    return up && outcome.failure.empty() && ended_well() ? 0 : 1;
  }

  /// Who feeds whom, and how to look and act by DDS.
  supervisor::CellView view_of_cell() {
    supervisor::CellView view;
    std::map<std::string, std::string> writer;  // topic -> component
    const auto each = [&](auto visit) {
      for (LoadedProcess& process : loaded_.processes)
        for (LoadedComponent& member : process.components)
          if (member.component)
            for (const Port* port : member.component->ports()) visit(member.file->name, *port);
      each_port([&](std::size_t index, const Port& port) { visit(executor_.component(index).name, port); });
    };
    each([&](const std::string& component, const Port& port) {
      // What two write is lost only with both.
      if (port.direction() == Port::Direction::output && !shared_topics_.contains(port.topic))
        writer[port.topic] = component;
    });
    each([&](const std::string& component, const Port& port) {
      if (port.direction() != Port::Direction::input ||
          static_cast<const InputPort&>(port).options().optional)
        return;
      if (const auto found = writer.find(port.topic); found != writer.end() && found->second != component)
        view.dependents[found->second].push_back(component);
    });
    for (const auto& process : loaded_.cell->processes) {
      view.processes.push_back(process.name);
      for (const auto& component : process.components) view.process_of[component.name] = process.name;
    }
    view.heard = [this] {
      std::set<std::string> heard{file_.name};
      for (const auto& status : client_->processes()) {
        auto& last = last_status_[status.process_name().c_str()];
        if (status.pid() != 0 && status.at().time_ns() != last) heard.insert(status.process_name().c_str());
        last = status.at().time_ns();
      }
      return heard;
    };
    view.components = [this] {
      std::map<std::string, supervisor::CellView::Seen> seen;
      for (const auto& status : client_->components())
        seen[status.component_name().c_str()] = {status.failure().c_str(),
                                                 status.state() == lifecycle::STATE_ERROR,
                                                 status.state() == lifecycle::STATE_ACTIVE};
      return seen;
    };
    const auto requests = [this](lifecycle::Transition transition) {
      return [this, transition](const std::string& component) -> std::string {
        const auto reply =
            client_->request(client_->process_of(component), component, transition, Duration::seconds(5.0));
        if (!reply) return "its process does not answer";
        return reply->done() ? "" : reply->text().c_str();
      };
    };
    view.deactivate = requests(lifecycle::TRANSITION_DEACTIVATE);
    view.activate = requests(lifecycle::TRANSITION_ACTIVATE);
    for (const LoadedProcess& process : loaded_.processes)
      for (const LoadedComponent& member : process.components)
        if (member.component && !member.component->claims().empty()) view.held.insert(member.file->name);
    for (std::size_t i = 0; i < executor_.size(); ++i)
      if (!executor_.component(i).claims().empty()) view.held.insert(executor_.component(i).name);
    view.notify = [this](bool is_fault, const std::string& from, const std::string& text) {
      service_->publish(is_fault ? event::SEVERITY_FAULT : event::SEVERITY_NOTE, from, text);
    };
    return view;
  }

  void leave_progress() {
    if (!job_.runs()) return;
    const job::JobStatus status = job_.status();
    progress_.leave(status.progress(), status.text().c_str());
  }

  void watch_address() {
    const auto news = address_.look();
    if (!news) return;
    if (news->is_back) {
      node_.network_is_back();
      spdlog::warn("{}: {}", file_.name, news->text);  // the log leaves notes out
    }
    service_->publish(news->is_back ? event::SEVERITY_NOTE : event::SEVERITY_FAULT, file_.name, news->text);
  }

  void say_how_the_job_ended() {
    if (job_.is_well()) return;
    const job::JobStatus status = job_.status();
    spdlog::error("job `{}` failed: {}", status.name().c_str(), status.text().c_str());
  }

  static recorder::Source source(const std::string& topic, const std::string& type,
                                 const std::string& profile) {
    const auto* known = recording::built_in_type(type);
    return {topic, type, profile, known != nullptr ? std::string{known->idl} : ""};
  }

  /// Every output of the cell, read as it travels.
  void record_topics() {
    if (recorder_ == nullptr) return;
    for (LoadedProcess& process : loaded_.processes)
      for (LoadedComponent& member : process.components) {
        if (!member.component) continue;
        for (const Port* port : member.component->ports()) record_topic(*port);
      }
    each_port([&](std::size_t, Port& port) { record_topic(port); });
  }

  void record_topic(const Port& port) {
    if (port.direction() != Port::Direction::output || !recorder_->is_wanted(port.topic)) return;
    if (port.type() == typeid(standby::WarmState))
      return;  // what two tell each other, and the loop's rate of it
    const auto* type = dds::WireTypes::all().find(port.type());
    // Notices of several components go by one topic: one reader has them all.
    if (type == nullptr || !recorded_.insert(port.topic).second) return;
    dds::Profile profile = node_.profile(port.profile);
    profile.deadline = {};  // a recorder takes what comes
    const recorder::Source from = source(port.topic, type->name(), port.profile);
    topics_.push_back(
        node_.raw_reader(port.topic, from.type, profile, [this, from](const dds::RawSample& sample) {
          recorder_->record(from, std::string{sample.writer}, sample.sequence, Instant{sample.sent_ns},
                            utc_now(), sample.cdr);
        }));
  }

  /// The components are down by then: the launcher goes on to the next process when it sees the file.
  void write_outcome() {
    if (options_.outcome.empty()) return;
    nlohmann::json outcome = loop_outcome(status_, file_.period);
    outcome["faults"] = faults_at_end_;
    if (recorder_ != nullptr && std::filesystem::exists(recorder_->file()))
      outcome["recording"] = std::filesystem::absolute(recorder_->file()).string();
    if (job_.runs()) outcome["job"] = job_.outcome();
    write_whole(options_.outcome, outcome);
  }

  ServiceManager manager_ = ServiceManager::from_environment();  // before any thread
  const ProcessOptions& options_;
  LoadedCell& loaded_;
  const config::CellProcess& file_;
  ComponentFaults faults_;  // before the executor, whose components write into these three
  NoticeLog log_{options_.simulated};
  JobFollower job_;
  /// Of each component, by its index.
  struct Member {
    std::uint32_t id = 0;  // number in the cell file
    Standby* standby = nullptr;
  };
  std::vector<Member> members_;
  HungLoop hung_;
  std::set<std::string> shared_topics_;  // written by two components, whichever leads
  Executor executor_;
  ProcessControl control_;
  dds::Node node_;
  NodeCourier courier_{node_, *loaded_.cell, file_.host};
  AddressWatch address_{node_.options().addresses.empty() ? "127.0.0.1" : node_.options().addresses.front()};
  std::vector<std::string> faults_at_end_;
  std::deque<stage::AxisState> axes_;  // newest state of each, the loop's; addresses stay
  std::unique_ptr<dds::ProcessService> service_;
  std::unique_ptr<dds::Connection> ends_;    // of processes on other PCs
  std::unique_ptr<dds::CellClient> client_;  // the supervisor's
  std::map<std::string, std::int64_t> last_status_;
  std::atomic<bool> asked_to_stop_{false};
  const pid_t parent_ = options_.launcher != 0 ? options_.launcher : getppid();
  std::optional<Instant> orphan_since_;
  bool resting_ = false, told_rest_ = false;
  MemoryKeeper memory_{file_.realtime};
  recorder::Recorder* recorder_ = nullptr;
  supervisor::Supervisor* supervisor_ = nullptr;
  std::vector<std::unique_ptr<dds::Connection>> topics_;
  std::set<std::string> recorded_;
  ProcessStatus status_;
  ProgressFile progress_{options_.outcome};
};

}  // namespace

std::filesystem::path rest_file(const std::filesystem::path& outcome) {
  return std::filesystem::path{outcome}.replace_extension(".rest");
}

int run_process(const ProcessOptions& options, const ProcessOrders& orders) {
  LoadedCell loaded = load_cell(options.cell);
  LoadedProcess* process = loaded.process(options.process);
  if (process == nullptr)
    throw InputError{options.cell.string(), "`" + options.process + "` is no process of this cell",
                     mend_name(options.process, loaded.process_names())};
  const ProcessClaim claim{*loaded.cell, options.process};
  if (options.launcher == 0)
    spdlog::info("invar {}: process `{}` of cell `{}` ({}) starts in {}, pid {}", INVAR_VERSION,
                 options.process, loaded.cell->name, options.cell.string(),
                 options.simulated ? "simulated time" : "real time", getpid());
  if (!wait_for_address(*loaded.cell, process->file->host, orders.stop)) return 0;
  if (process->file->realtime) keep_memory_small();
  return RunningProcess{options, loaded, *process}.run(orders);
}

}  // namespace invar::tools
