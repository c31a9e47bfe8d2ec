#include "tools/cell/process.hpp"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>

#include "components/recorder/recorder.hpp"
#include "components/supervisor/supervisor.hpp"
#include "core/component/standby.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/node.hpp"
#include "core/dds/process_service.hpp"
#include "core/dds/simulated_clock.hpp"
#include "core/executor/locked_memory.hpp"
#include "core/executor/process_control.hpp"
#include "core/job/job_component.hpp"
#include "tools/cell/axis_black_box.hpp"
#include "tools/cell/component_faults.hpp"
#include "tools/cell/each_port.hpp"
#include "tools/cell/hung_loop.hpp"
#include "tools/cell/job_follower.hpp"
#include "tools/cell/last_words.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/node_courier.hpp"
#include "tools/cell/notice_log.hpp"
#include "tools/cell/partner_ends.hpp"
#include "tools/cell/process_claim.hpp"
#include "tools/cell/process_node.hpp"
#include "tools/cell/rest_order.hpp"
#include "tools/cell/service_manager.hpp"
#include "tools/cell/standbys.hpp"
#include "tools/cell/supervised_cell.hpp"
#include "tools/cell/topic_recording.hpp"
#include "tools/host/own_host.hpp"

namespace invar::tools {

namespace {

/// Where models go that `invar job apply` sends, beside the black boxes.
constexpr const char* received_models = "out/models";

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
      if (redundant != nullptr) partners_.add(redundant->standby());
      executor_.add(std::move(member.component), {.type = member.file->type,
                                                  .parameters = std::move(member.prepared.infos),
                                                  .storage = member.prepared.parameters,
                                                  .every = static_cast<std::uint32_t>(member.file->every),
                                                  .latencies = member.file->latencies,
                                                  .check = member.prepared.check});
    }
    if (recorder_ != nullptr) recording_.emplace(*recorder_, node_);
    join_directly();
    black_box_.fill(executor_, [this](event::Severity level, const std::string& text) { say(level, text); });
    each_port(executor_, [&](std::size_t index, Port& port) {
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
    if (supervisor_ != nullptr)
      supervisor_->connect(
          supervised_.view([this](bool is_fault, const std::string& from, const std::string& text) {
            service_->publish(is_fault ? event::SEVERITY_FAULT : event::SEVERITY_NOTE, from, text);
          }));
    if (hears_of_ends) partners_.hear(node_, loaded_.cell->name);
  }

  int run(const ProcessOrders& orders) {
    if (supervisor_ != nullptr) supervised_.connect(node_);
    return options_.simulated ? run_simulated(orders.stop) : run_by_the_clock(orders);
  }

 private:
  /// What is wrong with a component though it is stepped.
  std::string fault_of(std::size_t index) {
    const std::string fault = hung_.look(executor_) ? HungLoop::text : faults_.of(index, executor_.now());
    const Standby* standby = members_.at(index).standby;
    if (standby == nullptr || executor_.state(index) != LifecycleState::active) return fault;
    return standby->leads() ? fault : standby->fault();
  }

  /// Joins signals of one process directly, but for those that another process writes when it leads. Commands (inboxes) travel by DDS, also within a process, so that every
  /// sender takes the same way.
  void join_directly() {
    each_port(executor_, [&](std::size_t, Port& output) {
      if (output.direction() != Port::Direction::output || shared_topics_.contains(output.topic)) return;
      each_port(executor_, [&](std::size_t, Port& input) {
        if (input.direction() == Port::Direction::input && input.topic == output.topic)
          static_cast<OutputPort&>(output).connect(static_cast<InputPort&>(input));
      });
    });
  }

  bool is_written_here(const std::string& topic) {
    if (shared_topics_.contains(topic)) return false;
    bool found = false;
    each_port(executor_, [&](std::size_t, Port& port) {
      found = found || (port.direction() == Port::Direction::output && port.topic == topic);
    });
    return found;
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

  void come_to_rest() {
    // The others of the cell come to rest now, too: what is wrong later is so because they stop.
    if (!rest_.is_resting()) faults_at_end_ = faults();
    rest_.come_to_rest();
  }

  [[nodiscard]] bool has_handed_over() {
    std::vector<Standby*> standbys;
    for (const Member& member : members_)
      if (member.standby != nullptr) standbys.push_back(member.standby);
    return rest_.has_handed_over(standbys);
  }

  RestOrder::Parent look_at_parent() {
    // Nobody says who notices first; who records leaves last, or the end of the others would be missing.
    const auto parent = rest_.look(recorder_ != nullptr ? Duration::seconds(1.0) : Duration{});
    if (parent == RestOrder::Parent::newly_gone)
      say(event::SEVERITY_WARNING, "`invar run` is no more: coming to rest and stopping");
    return parent;
  }

  int run_by_the_clock(const ProcessOrders& orders) {
    each_port(executor_, [&](std::size_t index, Port& port) {
      if (port.direction() == Port::Direction::output)
        node_.bind(static_cast<OutputPort&>(port), {.period = file_.realtime ? file_.period : Duration{},
                                                    .separation = separation(index, port)});
      else if (port.direction() == Port::Direction::inbox || !is_written_here(port.topic))
        node_.bind(static_cast<InputPort&>(port));
    });
    if (recording_) recording_->read_all(loaded_, executor_);
    executor_.at_cycle_end([this] { node_.cycle_ended(); });
    node_.start();
    service_->start();
    executor_.start();
    const bool up = bring_up();
    service_->publish_status();  // who waits for the cell need not wait for the next regular one
    if (up) manager_.ready();
    auto parent = RestOrder::Parent::there;
    while (up && parent != RestOrder::Parent::gone_long && !orders.stop.load() && !asked_to_stop_ &&
           executor_.is_running() && (!job_.has_ended() || rest_.is_resting())) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (const std::string refused = memory_.look(); !refused.empty()) say(event::SEVERITY_WARNING, refused);
      partners_.look();
      parent = look_at_parent();
      if (parent != RestOrder::Parent::there || orders.rest.load() ||
          (orders.renew.load() && has_handed_over()))
        come_to_rest();
      manager_.feed(executor_.counters().executed);
      leave_progress();
      watch_address();
      log_.write_waiting();
    }
    take_down();
    if (recording_) recording_->end();
    node_.stop();
    return up && ended_well() ? 0 : 1;
  }

  void take_down() {
    manager_.stopping();
    say_how_the_job_ended();
    status_ = control_.status();
    if (!rest_.is_resting()) faults_at_end_ = faults();
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
    each_port(executor_, [&](std::size_t index, Port& port) {
      if (port.direction() == Port::Direction::output)
        clock.bind(static_cast<OutputPort&>(port), separation(index, port));
      else if (port.direction() == Port::Direction::inbox || !is_written_here(port.topic))
        clock.bind(static_cast<InputPort&>(port));
    });
    if (options_.paced) clock.listen_outside();
    if (recording_) clock.tap([this](const dds::LockstepSample& sample) { recording_->take(sample); });
    node_.start();
    service_->start();
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
  ComponentFaults faults_;  // before the executor, whose components write into these four
  NoticeLog log_{options_.simulated};
  JobFollower job_;
  AxisBlackBox black_box_;
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
  std::unique_ptr<dds::ProcessService> service_;
  PartnerEnds partners_;
  std::atomic<bool> asked_to_stop_{false};
  const pid_t parent_ = options_.launcher != 0 ? options_.launcher : getppid();
  RestOrder rest_{options_.outcome, executor_, parent_};
  MemoryKeeper memory_{file_.realtime};
  recorder::Recorder* recorder_ = nullptr;
  supervisor::Supervisor* supervisor_ = nullptr;
  SupervisedCell supervised_{loaded_, {file_.name, executor_, shared_topics_}};
  std::optional<TopicRecording> recording_;
  ProcessStatus status_;
  ProgressFile progress_{options_.outcome};
};

}  // namespace

int run_process(const ProcessOptions& options, const ProcessOrders& orders) {
  LoadedCell loaded = load_cell(options.cell);
  LoadedProcess* process = loaded.process(options.process);
  if (process == nullptr)
    throw InputError{options.cell.string(), "`" + options.process + "` is no process of this cell",
                     config::mend_name(options.process, loaded.process_names())};
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
