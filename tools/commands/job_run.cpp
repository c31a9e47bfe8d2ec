// `invar job run|list|cancel`: the jobs of a running cell - started, followed, stopped.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <set>

#include "idl/job.h"
#include "tools/commands/job.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/job_progress.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;

struct JobRunOptions {
  JobRunOptions(CLI::App& command, std::vector<Word> words) : call{command, std::move(words)} {}
  CellCall call;
  std::string component;
  std::string arguments;
  bool detach = false;
  bool json = false;
};

std::string phase_text(job::JobPhase phase) {
  switch (phase) {
    case job::JOB_IDLE:
      return "idle";
    case job::JOB_RUNNING:
      return "running";
    case job::JOB_DONE:
      return "done";
    case job::JOB_FAILED:
      return "failed";
    case job::JOB_CANCELLED:
      return "cancelled";
  }
  return "?";
}

nlohmann::ordered_json job_json(const std::string& component, const job::JobStatus& status) {
  return {{"component", component},
          {"id", status.id()},
          {"job", status.name().c_str()},
          {"phase", phase_text(status.phase())},
          {"progress", status.progress()},
          {"text", status.text().c_str()},
          {"result", status.result_path().c_str()},
          {"time_ns", status.at().time_ns()}};
}

/// The components that run jobs, what they say, and commands to them.
class Jobs {
 public:
  explicit Jobs(LiveCell& cell) : cell_{cell} {}

  /// Finds the topics by which jobs are commanded; waits for one of `component`, or else for all that the cell file names,
  /// without a file for any.
  bool find(const std::string& component) {
    std::set<std::string> wanted{component};
    if (component.empty()) {
      wanted.clear();
      if (cell_.file() != nullptr)
        for (const auto& [job, owner] : cell_.file()->jobs) wanted.insert(owner);
    }
    const auto found = [&] {
      return !components_.empty() && std::all_of(wanted.begin(), wanted.end(),
                                                 [&](const auto& one) { return components_.contains(one); });
    };
    const auto end = Clock::now() + std::chrono::nanoseconds{cell_.patience().ns};
    while (Clock::now() < end) {
      look();
      if (found() || !sleep_for(Duration::milliseconds(20))) break;
    }
    return component.empty() ? !components_.empty() : components_.contains(component);
  }
  /// Waits until each says how it is, as far as it does.
  void wait_for_statuses() {
    const auto end = Clock::now() + std::chrono::seconds{2};
    while (Clock::now() < end) {
      look();
      bool complete = true;
      for (const auto& [component, parts] : components_) complete = complete && status(component).has_value();
      if (complete || !sleep_for(Duration::milliseconds(50))) return;
    }
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& [component, parts] : components_) names.push_back(component);
    return names;
  }
  std::optional<job::JobStatus> status(const std::string& component) {
    const std::lock_guard lock{mutex_};
    const auto found = statuses_.find(component);
    return found == statuses_.end() ? std::nullopt : std::optional{found->second};
  }
  /// Says so where the component would not obey, for the clock of this PC is behind.
  bool is_too_far_behind(const std::string& component, const std::string& command) {
    const std::string why = cell_.too_far_behind(cell_.process_of(component));
    if (!why.empty()) std::cerr << command << ": " << why << '\n';
    return !why.empty();
  }
  /// Follows on that a component does not answer.
  std::string clocks_apart(const std::string& component) {
    return cell_.clocks_apart(cell_.process_of(component));
  }
  /// False: the component did not connect in time.
  bool send(const std::string& component, job::JobCommandKind kind, std::uint64_t id, const std::string& name,
            const std::string& arguments) {
    auto& writer = components_.at(component).writer;
    if (!writer) {
      // Job commands are owned exclusively: whoever cancels outranks whoever started the job and still watches it.
      dds::Profile profile = cell_.node().profile("command");
      if (kind == job::JOB_CANCEL) ++profile.strength;
      writer = std::make_unique<dds::Writer<job::JobCommand>>(
          cell_.node().writer<job::JobCommand>(dds::topic_name(cell_.name(), component, "job"), profile));
    }
    const auto end = Clock::now() + std::chrono::nanoseconds{cell_.patience().ns};
    while (writer->connection().matched() == 0)
      if (Clock::now() > end || !sleep_for(Duration::milliseconds(20))) return false;
    sleep_for(Duration::milliseconds(100));  // the reader's side of the match
    job::JobCommand command;
    command.cell(cell_.cell_id());
    command.id(id);
    command.kind(kind);
    command.name(name);
    command.arguments(arguments);
    return writer->write(command);
  }

 private:
  struct Parts {
    std::unique_ptr<dds::Writer<job::JobCommand>> writer;
    std::unique_ptr<dds::Connection> reader;
  };

  /// A component with an inbox of job commands; its status stands beside it.
  void look() {
    const std::string prefix = "cell/" + cell_.name() + "/";
    for (const auto& end : cell_.node().snapshot().endpoints) {
      if (end.is_local || end.is_writer || end.type != "invar::job::JobCommand" ||
          !end.topic.starts_with(prefix) || !end.topic.ends_with("/job"))
        continue;
      const std::string component = end.topic.substr(prefix.size(), end.topic.size() - prefix.size() - 4);
      if (components_.contains(component)) continue;
      components_[component].reader =
          cell_.node().reader<job::JobStatus>(dds::topic_name(cell_.name(), component, "status"), "state",
                                              [this, component](const job::JobStatus& status) {
                                                const std::lock_guard lock{mutex_};
                                                statuses_[component] = status;
                                              });
    }
  }

  LiveCell& cell_;
  std::mutex mutex_;
  std::map<std::string, job::JobStatus> statuses_;
  std::map<std::string, Parts> components_;  // last: nothing arrives before all else stands
};

/// The component that runs the job: by the cell file, by --component, or the only one there is.
std::string component_of(LiveCell& cell, Jobs& jobs, const JobRunOptions& options, const std::string& name) {
  if (!options.component.empty()) return options.component;
  if (cell.file() != nullptr) {
    const auto& known = cell.file()->jobs;
    if (const auto found = known.find(name); found != known.end()) return found->second;
    std::vector<std::string> names;
    std::string list;
    for (const auto& [job, component] : known) {
      names.push_back(job);
      list += (list.empty() ? "" : ", ") + job;
    }
    const std::string near = config::nearest(name, names);
    throw InputError{"JOB", "`" + name + "` is no job of " + cell.file()->file.string(),
                     near.empty() ? (list.empty() ? "it has none" : "there are: " + list)
                                  : "did you mean `" + near + "`?"};
  }
  const bool any = jobs.find("");
  const auto names = jobs.names();
  if (names.size() > 1)
    throw InputError{"JOB", "several components run jobs", "say which one with --component"};
  return any ? names.front() : "";
}

/// Exit status of a job that ended.
int report(const JobRunOptions& options, const std::string& component, const job::JobStatus& status) {
  if (options.json)
    std::cout << job_json(component, status).dump(2) << '\n';
  else
    std::cout << status.name().c_str() << ": " << phase_text(status.phase())
              << (status.phase() == job::JOB_DONE ? "" : std::string{": "} + status.text().c_str())
              << (status.result_path().to_string().empty()
                      ? ""
                      : std::string{"; results in "} + status.result_path().c_str())
              << '\n';
  return status.phase() == job::JOB_DONE ? 0 : 1;
}

int follow(const JobRunOptions& options, Jobs& jobs, const std::string& component, const std::string& name,
           std::uint64_t id) {
  JobProgress progress;
  bool cancelling = false, taken = false;
  auto last_heard = Clock::now();
  auto last_sent = Clock::now();
  std::int64_t last_time = 0;
  for (;;) {
    const auto status = jobs.status(component);
    if (status && status->id() == id) {
      taken = true;
      if (status->at().time_ns() != last_time) last_heard = Clock::now();
      last_time = status->at().time_ns();
      progress.show(status->progress(), status->text().c_str());
      if (status->phase() != job::JOB_RUNNING && status->phase() != job::JOB_IDLE) {
        progress.end();
        return report(options, component, *status);
      }
    } else if (taken) {  // sent again, it would begin anew by itself
      progress.end();
      std::cerr << options.call.command << ": `" << component
                << "` was started again meanwhile: the job has ended, and its changes were taken back\n";
      return 1;
    } else if (Clock::now() - last_heard > std::chrono::duration<double>{options.call.patience}) {
      progress.end();
      std::cerr << options.call.command << ": `" << component << "` does not take the job"
                << (status && status->phase() == job::JOB_RUNNING ? std::string{": "} + status->text().c_str()
                                                                  : "; is it active?")
                << jobs.clocks_apart(component) << '\n';
      return 1;
    } else if (Clock::now() - last_sent > std::chrono::seconds{1}) {
      last_sent = Clock::now();  // the same id is carried out once
      jobs.send(component, job::JOB_RUN, id, name, options.arguments);
    }
    if (interrupted() && !cancelling) {
      progress.end();
      std::cerr << "cancelling `" << name << "`\n";
      jobs.send(component, job::JOB_CANCEL, id, name, "");
      cancelling = true;
      last_sent = Clock::now();
    }
    if (cancelling && Clock::now() - last_sent > std::chrono::duration<double>{options.call.patience}) {
      std::cerr << options.call.command << ": `" << component << "` does not confirm that it stopped"
                << jobs.clocks_apart(component) << '\n';
      return 1;
    }
    const timespec pause{0, 20'000'000};
    nanosleep(&pause, nullptr);
  }
}

int run(JobRunOptions& options) {
  options.call.resolve();
  (void)interrupted();
  LiveCell cell{options.call};
  Jobs jobs{cell};
  const std::string& name = options.call.word(0);
  const std::string component = cell.found() ? component_of(cell, jobs, options, name) : "";
  if (component.empty() || !jobs.find(component)) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  jobs.wait_for_statuses();
  if (const auto before = jobs.status(component); before && before->phase() == job::JOB_RUNNING) {
    std::cerr << options.call.command << ": job `" << before->name().c_str() << "` is running ("
              << std::lround(before->progress() * 100.0) << " %); wait for it or cancel it\n";
    return 1;
  }
  if (jobs.is_too_far_behind(component, options.call.command)) return 1;
  std::random_device random;
  const std::uint64_t id = ((std::uint64_t{random()} << 32U) | random()) | 1U;
  if (!jobs.send(component, job::JOB_RUN, id, name, options.arguments)) {
    std::cerr << options.call.command << ": `" << component << "` cannot be reached\n";
    return 1;
  }
  if (!options.detach) return follow(options, jobs, component, name, id);
  sleep_for(Duration::milliseconds(300));
  return 0;
}

int list(JobRunOptions& options) {
  options.call.resolve();
  LiveCell cell{options.call};
  Jobs jobs{cell};
  if (cell.found() && jobs.find("")) jobs.wait_for_statuses();
  std::map<std::string, std::string> known;  // job -> component
  if (cell.file() != nullptr) known = cell.file()->jobs;
  for (const auto& component : jobs.names())
    if (const auto status = jobs.status(component); status && !status->name().to_string().empty())
      known.emplace(status->name().c_str(), component);
  TextTable table{{"job", "component", "phase", "progress>", "what", "result"}};
  auto json = nlohmann::ordered_json::array();
  for (const auto& [job, component] : known) {
    const auto status = jobs.status(component);
    const bool is_last = status && job == status->name().c_str();
    if (options.json) {
      json.push_back(is_last ? job_json(component, *status)
                             : nlohmann::ordered_json{{"component", component},
                                                      {"job", job},
                                                      {"phase", status ? "idle" : "no answer"}});
    } else if (is_last) {
      table.add({job, component, phase_text(status->phase()),
                 std::to_string(std::lround(status->progress() * 100.0)) + " %", status->text().c_str(),
                 status->result_path().c_str()});
    } else {
      table.add({job, component, status ? "idle" : "no answer", "-", "", ""});
    }
  }
  if (options.json) std::cout << json.dump(2) << '\n';
  if (!table.empty()) table.print(std::cout);
  if (cell.found() && cell.file() != nullptr && cell.file()->jobs.empty()) {
    std::cerr << "the cell " << cell.name() << " has no jobs; its file lists them below `jobs`\n";
    return 0;
  }
  if (jobs.names().empty()) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  return 0;
}

int cancel(JobRunOptions& options) {
  options.call.resolve();
  LiveCell cell{options.call};
  Jobs jobs{cell};
  if (!cell.found() || !jobs.find(options.component)) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  jobs.wait_for_statuses();
  const std::string& name = options.call.word(0);
  for (const auto& component : jobs.names()) {
    const auto status = jobs.status(component);
    if (!status || status->phase() != job::JOB_RUNNING) continue;
    if (!name.empty() && name != status->name().c_str()) continue;
    if (!options.component.empty() && component != options.component) continue;
    if (jobs.is_too_far_behind(component, options.call.command)) return 1;
    if (!jobs.send(component, job::JOB_CANCEL, status->id(), status->name().c_str(), "")) return 1;
    const auto end = Clock::now() + std::chrono::nanoseconds{cell.patience().ns};
    while (Clock::now() < end && jobs.status(component)->phase() == job::JOB_RUNNING)
      if (!sleep_for(Duration::milliseconds(20))) break;
    const auto after = jobs.status(component);
    if (options.json)
      std::cout << job_json(component, *after).dump(2) << '\n';
    else
      std::cout << after->name().c_str() << ": " << phase_text(after->phase()) << '\n';
    return after->phase() == job::JOB_CANCELLED ? 0 : 1;
  }
  std::cerr << options.call.command << ": " << (name.empty() ? "no job" : "no job `" + name + "`")
            << " is running\n";
  return 1;
}

template <class Action>
std::shared_ptr<JobRunOptions> add(CLI::App& group, const std::string& name, const std::string& about,
                                   std::vector<Word> words, const std::string& footer, Action action) {
  auto* command = group.add_subcommand(name, about);
  command->footer(footer);
  auto options = std::make_shared<JobRunOptions>(*command, std::move(words));
  command->callback([options, action] {
    if (const int result = action(*options); result != 0) throw CLI::RuntimeError(result);
  });
  command->add_option("--component", options->component, "the component that runs it, without a cell file");
  return options;
}

}  // namespace

void add_job_run(CLI::App& group) {
  auto started =
      add(group, "run", "Run a job of a running cell and follow it to its end", {{"JOB", "its name"}},
          "Example: invar job run deployment/xy-table.yaml calibrate-geometry\n"
          "Ctrl-C cancels the job. Exit status: 0 done; 1 failed, cancelled or no answer; 2 a fault of "
          "the call or the file",
          run);
  auto* command = group.get_subcommand("run");
  constexpr std::size_t longest = 4096;  // string<4096> of idl/job.idl
  command
      ->add_option("--arguments", started->arguments,
                   "for a job of your own component, as YAML; the jobs of Invar take none")
      ->check(CLI::Validator{[](const std::string& text) {
                               return text.size() <= longest
                                          ? std::string{}
                                          : "has " + std::to_string(text.size()) +
                                                " characters; give at most " + std::to_string(longest);
                             },
                             ""});
  command->add_flag("--detach", started->detach, "start it only");
  command->add_flag("--json", started->json, "print its end as JSON; progress goes to the error output");
  auto listed =
      add(group, "list", "List the jobs of a running cell and how far they are", {},
          "Example: invar job list deployment/xy-table.yaml\n"
          "Exit status: 0; 1 no component that runs jobs answers; 2 a fault of the call or the file",
          list);
  group.get_subcommand("list")->add_flag("--json", listed->json, "print it as JSON");
  auto cancelled =
      add(group, "cancel", "Cancel the job that runs", {{"JOB", "only if it is this one", false}},
          "Example: invar job cancel deployment/xy-table.yaml\n"
          "Exit status: 0 cancelled; 1 none is running or no answer; 2 a fault of the call or the file",
          cancel);
  group.get_subcommand("cancel")->add_flag("--json", cancelled->json, "print what became of it as JSON");
}

}  // namespace invar::tools
