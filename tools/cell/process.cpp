#include "tools/cell/process.hpp"

#include <spdlog/spdlog.h>

#include <chrono>
#include <thread>

#include "core/dds/node.hpp"
#include "core/executor/process_control.hpp"
#include "idl/job.h"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

namespace {

dds::NodeOptions node_options(const LoadedCell& loaded, const config::CellProcess& process) {
  dds::NodeOptions options;
  options.cell = loaded.cell->name;
  options.process = process.name;
  options.domain = static_cast<std::uint32_t>(loaded.cell->domain);
  options.shared_memory = loaded.cell->shared_memory;
  for (const auto& host : loaded.cell->hosts)
    if (host.name == process.host) options.addresses = {host.address};
  if (process.realtime) options.realtime_priority = std::max(0, process.realtime->priority - 10);
  return options;
}

/// Joins signals of one process directly. Commands (inboxes) travel by DDS, also within a process, so that every sender
/// takes the same way.
void join_directly(Executor& executor) {
  for (std::size_t i = 0; i < executor.size(); ++i)
    for (Port* port : executor.component(i).ports()) {
      if (port->direction() != Port::Direction::output || port->topic.empty()) continue;
      for (std::size_t k = 0; k < executor.size(); ++k)
        for (Port* other : executor.component(k).ports())
          if (other->direction() == Port::Direction::input && other->topic == port->topic)
            static_cast<OutputPort*>(port)->connect(*static_cast<InputPort*>(other));
    }
}

bool is_written_here(const Executor& executor, const std::string& topic) {
  for (std::size_t i = 0; i < executor.size(); ++i)
    for (const Port* port : executor.component(i).ports())
      if (port->direction() == Port::Direction::output && port->topic == topic) return true;
  return false;
}

void bind_ports(Executor& executor, const config::CellProcess& process, dds::Node& node) {
  const bool paced = process.realtime.has_value();
  for (std::size_t i = 0; i < executor.size(); ++i) {
    const auto& rates = process.components[i].publish_rates;
    for (Port* port : executor.component(i).ports()) {
      if (port->topic.empty()) continue;
      if (port->direction() == Port::Direction::output) {
        dds::OutputBinding binding;
        if (paced) binding.period = process.period;
        if (const auto rate = rates.find(port->name()); rate != rates.end())
          binding.separation = Duration::seconds(1.0 / rate->second);
        node.bind(*static_cast<OutputPort*>(port), binding);
      } else if (port->direction() == Port::Direction::inbox || !is_written_here(executor, port->topic)) {
        node.bind(*static_cast<InputPort*>(port));
      }
    }
  }
}

/// The command that starts a job, put into the inbox of the component that runs it.
void start_job(const LoadedCell& loaded, Executor& executor, const std::string& job) {
  const auto found = loaded.cell->jobs.find(job);
  if (found == loaded.cell->jobs.end()) return;
  const auto index = executor.find(found->second);
  if (!index) return;
  auto* inbox = dynamic_cast<Inbox<job::JobCommand>*>(executor.component(*index).find_port("job"));
  if (inbox == nullptr) return;
  job::JobCommand command;
  command.cell(loaded.cell->id);
  command.id(1);
  command.kind(job::JOB_RUN);
  command.name(job);
  inbox->add_lane()(command, Instant{0});
}

bool bring_up(ProcessControl& control, const std::string& process) {
  for (const Transition transition : {Transition::configure, Transition::activate}) {
    const Outcome outcome = control.request("", transition);
    if (outcome.ok()) continue;
    spdlog::error("{}: {}", process, outcome.text());
    return false;
  }
  return true;
}

}  // namespace

int run_process(const ProcessOptions& options, const std::atomic<bool>& stop) {
  LoadedCell loaded = load_cell(options.cell);
  LoadedProcess* process = loaded.process(options.process);
  if (process == nullptr)
    throw InputError{options.cell.string(), "`" + options.process + "` is no process of this cell",
                     "use one of the names below `processes`"};
  ExecutorOptions executor_options = executor_options_of(*process->file);
  executor_options.simulated = options.simulated;
  Executor executor{executor_options};
  for (LoadedComponent& member : process->components) {
    member.component->simulated_time = options.simulated;
    executor.add(std::move(member.component), {.type = member.file->type,
                                               .parameters = std::move(member.prepared.infos),
                                               .storage = member.prepared.parameters,
                                               .every = static_cast<std::uint32_t>(member.file->every)});
  }
  join_directly(executor);
  if (!options.job.empty()) start_job(loaded, executor, options.job);
  dds::Node node{node_options(loaded, *process->file), dds::load_profiles(loaded.cell->profiles)};
  bind_ports(executor, *process->file, node);
  ProcessControl control{executor};
  node.start();
  executor.start();
  const bool up = bring_up(control, options.process);
  while (up && !stop.load() && executor.is_running()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    for (const dds::Alarm& alarm : node.take_alarms()) spdlog::warn("{}: {}: {}", options.process, alarm.topic, alarm.text);
  }
  control.stop();
  node.stop();
  return up ? 0 : 1;
}

}  // namespace invar::tools
