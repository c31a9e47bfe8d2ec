#include "tools/cell/launcher.hpp"

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>

#include "core/base/temporary_folder.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/identity.hpp"
#include "core/dds/node.hpp"
#include "core/dds/simulated_clock.hpp"
#include "tools/cell/children_watch.hpp"
#include "tools/cell/last_words.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/process.hpp"
#include "tools/cell/process_claim.hpp"
#include "tools/cell/restart_news.hpp"
#include "tools/cell/restarts.hpp"
#include "tools/cell/standbys.hpp"
#include "tools/host/own_host.hpp"

extern char** environ;  // NOLINT: POSIX names it so

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void sleep_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(5)); }

struct Child {
  std::string name;
  pid_t pid = -1;
  bool running = true;
  int status = 0;
  Clock::time_point began = Clock::now(), ended{};
  Restarts restarts{};
  std::optional<Clock::time_point> next_start{};  // after it ended by itself

  void poll(bool wait) {
    int raw = 0;
    if (!running || waitpid(pid, &raw, wait ? 0 : WNOHANG) != pid) return;
    running = false;
    ended = Clock::now();
    status = WIFEXITED(raw) ? WEXITSTATUS(raw) : 128 + WTERMSIG(raw);
  }
};

/// What a process leaves when its components are down.
std::filesystem::path outcome_of(const std::string& process, const std::filesystem::path& folder) {
  return folder / (process + ".json");
}

/// The program and the cell file are named where they lie: a link on the way may lead to another release by the time that a
/// process is started again.
Child spawn(const LaunchOptions& options, const std::string& process, bool simulated,
            const std::filesystem::path& folder, const Restarts& restarts = {},
            const std::string& last_end = "") {
  std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  if (program.ends_with(" (deleted)")) program = "/proc/self/exe";  // another was installed in its place
  std::vector<std::string> words{"invar",
                                 "run",
                                 std::filesystem::weakly_canonical(options.cell).string(),
                                 "--process",
                                 process,
                                 simulated ? "--simulated" : "--real-time",
                                 "--outcome",
                                 outcome_of(process, folder).string(),
                                 "--launcher",
                                 std::to_string(getpid())};
  std::filesystem::remove(outcome_of(process, folder));  // of an earlier life
  std::filesystem::remove(progress_file(outcome_of(process, folder)));
  std::filesystem::remove(rest_file(outcome_of(process, folder)));
  if (!options.job.empty()) words.insert(words.end(), {"--job", options.job});
  if (options.quiet) words.emplace_back("--quiet");
  if (restarts.count() > 0)
    words.insert(words.end(), {"--restarts", std::to_string(restarts.count()), "--last-end", last_end});
  if (!simulated) {
    const Instant now = monotonic_now();
    words.insert(words.end(), {"--stamps", std::to_string((utc_at(now) - now).ns)});
  }
  if (simulated && options.pace > 0.0) words.insert(words.end(), {"--pace", std::to_string(options.pace)});
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  // A group of its own: Ctrl-C reaches the launcher alone, which stops the cell in order.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
  posix_spawnattr_setpgroup(&attributes, 0);
  // Our orders wait until it takes them: before, they would kill it.
  sigset_t orders;
  sigemptyset(&orders);
  for (const int signal : {SIGTERM, SIGUSR1, SIGUSR2}) sigaddset(&orders, signal);
  posix_spawnattr_setsigmask(&attributes, &orders);
  // Fast DDS does not close its sockets on exec: a child would hold the launcher's ports.
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  Child child{process};
  child.restarts = restarts;
  const int error = posix_spawn(&child.pid, program.c_str(), &files, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) throw std::runtime_error{"process `" + process + "` cannot be started"};
  return child;
}

/// Waits for its end or for `condition`, so many seconds at most.
template <class Condition>
void wait_for(Child& child, Condition condition, double patience = 10.0) {
  const auto begin = Clock::now();
  for (child.poll(false); child.running && !condition() && seconds_since(begin) < patience; child.poll(false))
    sleep_a_little();
}

/// What moves brakes while all that it moves on and reads is still there, in whichever process.
void bring_to_rest(std::vector<Child>& children, const std::filesystem::path& folder) {
  for (Child& child : children)
    if (child.running) kill(child.pid, SIGUSR1);
  for (Child& child : children)
    wait_for(
        child, [&] { return std::filesystem::exists(rest_file(outcome_of(child.name, folder))); }, 5.0);
}

/// SIGTERM, patience, SIGKILL. Components come down process by process, in the order of the file; what the processes have to
/// do after that needs no order and goes on at the same time.
void stop_in_order(std::vector<Child>& children, const std::filesystem::path& folder) {
  for (Child& child : children) {
    if (!child.running) continue;
    kill(child.pid, SIGTERM);
    wait_for(child, [&] { return std::filesystem::exists(outcome_of(child.name, folder)); });
  }
  for (Child& child : children) {
    wait_for(child, [] { return false; });
    if (!child.running) continue;
    kill(child.pid, SIGKILL);
    child.poll(true);
  }
}

/// Starts a process again that was killed or failed, after a pause where it ends again and again. True while the cell goes on:
/// one that says by its status that its input is wrong would say so again.
bool keep_alive(std::vector<Child>& children, const LaunchOptions& options, const config::Cell& cell,
                const std::filesystem::path& folder, RestartNews& news) {
  for (Child& child : children) {
    child.poll(false);
    if (child.running) continue;
    if (child.status == 0 || child.status == 2) return false;
    const std::string how = "status " + std::to_string(child.status);
    if (!child.next_start) {
      const Duration pause =
          child.restarts.ended_after({std::chrono::nanoseconds{child.ended - child.began}.count()});
      child.next_start = child.ended + std::chrono::nanoseconds{pause.ns};
      for (const auto& process : cell.processes)
        if (process.name == child.name)
          news.tell(process,
                    {.how = how, .restarts = child.restarts.count(), .pause = pause, .process = child.pid});
    }
    if (Clock::now() >= *child.next_start)
      child = spawn(options, child.name, false, folder, child.restarts, how);
  }
  return true;
}

bool is_renewed(const Child& child, const config::Cell& cell) {
  using FileClock = std::filesystem::file_time_type::clock;
  const auto began = FileClock::now() - (Clock::now() - child.began);
  std::error_code none;
  const dds::KeyFolder keys{cell.security->keys};
  const auto written = std::filesystem::last_write_time(keys.certificate(child.name), none);
  return !none && written > began;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream{file};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

/// Looks now and then how far the job is, as the process that runs it says.
class JobNews {
 public:
  JobNews(const LaunchOptions& options, const config::Cell& cell, const std::filesystem::path& folder)
      : tell_{options.progress} {
    const auto job = cell.jobs.find(options.job);
    if (job == cell.jobs.end()) return;
    for (const auto& process : cell.processes)
      for (const auto& component : process.components)
        if (component.name == job->second) file_ = progress_file(outcome_of(process.name, folder));
  }
  void look() {
    if (!tell_ || file_.empty() || Clock::now() - looked_ < std::chrono::milliseconds{50}) return;
    looked_ = Clock::now();
    const auto news = nlohmann::json::parse(text_of(file_), nullptr, false);
    if (news.is_object()) tell_(news.value("fraction", 0.0), news.value("text", ""));
  }

 private:
  const std::function<void(double, const std::string&)>& tell_;
  std::filesystem::path file_;
  Clock::time_point looked_{};
};

/// What the launcher looks after while the processes run.
struct Beside {
  JobNews news;
  ChildrenWatch service;

  void look(const std::vector<Child>& children) {
    news.look();
    std::vector<ChildrenWatch::Child> seen;
    for (const Child& child : children) seen.push_back({child.name, child.pid, child.running});
    for (const pid_t hung : service.look(seen)) kill(hung, SIGKILL);
  }
};

/// One process after the other. Loops with a standby are handed over, and axes come to rest while all that they move on is still
/// there. Then the process ends in order, and begins with the certificate that is there now. A stop is not kept waiting.
void renew(std::vector<Child>& children, const LaunchOptions& options, const config::Cell& cell,
           const std::filesystem::path& folder, Beside& beside, const std::atomic<bool>& stop) {
  if (options.renew == nullptr || !options.renew->exchange(false) || !cell.security) return;
  const auto watched = [&](auto condition) {
    return [&, condition] {
      beside.look(children);
      return stop || condition();
    };
  };
  for (Child& child : children) {
    if (stop || !child.running || !is_renewed(child, cell)) continue;
    spdlog::warn("process `{}` has another certificate: it ends in order and starts anew", child.name);
    kill(child.pid, SIGUSR2);
    const auto rest = rest_file(outcome_of(child.name, folder));
    wait_for(child, watched([&] { return std::filesystem::exists(rest); }), 20.0);
    if (stop) return;
    if (child.running) kill(child.pid, SIGTERM);
    wait_for(child, watched([] { return false; }));
    if (stop) return;
    if (child.running) kill(child.pid, SIGKILL);
    child.poll(true);
    child = spawn(options, child.name, false, folder, child.restarts, "another certificate");
    wait_for(child, watched([] { return false; }), 3.0);  // the others are not away at the same time
  }
}

/// Simulated time has one keeper in a cell: the launcher of the first process's PC. The others follow.
bool keeps_time(const std::set<std::string>& hosts, const config::Cell& cell) {
  return hosts.contains(cell.processes.front().host);
}

bool any_ended(std::vector<Child>& children) {
  bool ended = false;
  for (Child& child : children) {
    child.poll(false);
    ended = ended || !child.running;
  }
  return ended;
}

bool any_runs(std::vector<Child>& children) {
  bool runs = false;
  for (Child& child : children) {
    child.poll(false);
    runs = runs || child.running;
  }
  return runs;
}

std::string keep_simulated_time(const LaunchOptions& options, const config::Cell& cell,
                                std::vector<Child>& children, const std::atomic<bool>& stop,
                                Clock::time_point begin, Beside& beside, LaunchOutcome& outcome) {
  const std::string& host = cell.processes.front().host;
  dds::NodeOptions node_options = node_on(cell, "launcher", host);
  if (node_options.identity) node_options.identity->name = config::launcher_name(host);
  dds::Node node{node_options, dds::load_profiles(cell.profiles)};
  std::vector<std::string> names;
  for (const auto& process : cell.processes) names.push_back(process.name);
  dds::SimulatedClockMaster master{node, names, cell.window};
  node.start();
  const auto given_up = [&] {
    beside.look(children);
    return stop.load() || any_ended(children);
  };
  // Somebody may have to start the other PCs by hand.
  const Duration patience = Duration::seconds(names.size() > children.size() ? 300.0 : 30.0);
  std::string failure = master.wait_for_all(patience, given_up);
  outcome.start_seconds = seconds_since(begin);
  if (failure.empty() && !stop) {
    const Instant end = Instant{} + Duration::seconds(options.duration > 0.0 ? options.duration : 1e9);
    const auto patience_of_a_window = Duration::seconds(120.0);
    const auto started = Clock::now();
    dds::Advance so_far;
    while (so_far.reached < end && !so_far.finished && so_far.failure.empty() && !given_up()) {
      const bool paced = options.pace > 0.0;
      so_far = master.advance_to(paced ? std::min(end, so_far.reached + cell.window) : end,
                                 patience_of_a_window, given_up);
      if (paced)
        std::this_thread::sleep_until(started + std::chrono::nanoseconds{static_cast<std::int64_t>(
                                                    1e9 * so_far.reached.in_seconds() / options.pace)});
    }
    failure = so_far.failure;
  }
  master.end();
  const auto ending = Clock::now();
  while (seconds_since(ending) < 5.0 && any_runs(children)) sleep_a_little();
  return stop ? "" : failure;
}

template <typename List, typename Name>
std::vector<std::string> names_of(const List& list, const Name& name) {
  std::vector<std::string> names;
  for (const auto& each : list) names.push_back(name(each));
  return names;
}

/// A run is silent while all is well: one line says what goes on and how to end it.
void announce(const std::set<std::string>& hosts, const config::Cell& cell, bool simulated) {
  std::string names, others;
  for (const auto& process : cell.processes) {
    std::string& list = hosts.contains(process.host) ? names : others;
    list += (list.empty() ? "" : ", ") + process.name;
  }
  spdlog::info("invar {}: cell `{}` runs {} in {}{}; Ctrl-C stops it in order", INVAR_VERSION, cell.name,
               names, simulated ? "simulated time" : "real time",
               others.empty() ? "" : " (" + others + " on other PCs)");
}

}  // namespace

LaunchOutcome launch(const LaunchOptions& options, const std::atomic<bool>& stop) {
  const auto begin = Clock::now();
  LaunchOutcome outcome;
  const LoadedCell loaded = load_cell(options.cell);
  const config::Cell& cell = *loaded.cell;
  if (!options.job.empty() && !cell.jobs.contains(options.job))
    throw InputError{
        cell.file.string() + ": jobs", "`" + options.job + "` is no job of this cell",
        config::mend_name(options.job, names_of(cell.jobs, [](const auto& job) { return job.first; }))};
  const std::set<std::string> hosts = own_hosts(cell, options.host);
  for (const auto& process : cell.processes)  // let go at once: the processes claim their names themselves
    if (hosts.contains(process.host)) (void)ProcessClaim{cell, process.name};
  for (const std::string& host : hosts)
    if (!wait_for_address(cell, host, stop)) return outcome;
  outcome.simulated = options.simulated.value_or(cell.simulated_time);
  if (!options.quiet) announce(hosts, cell, outcome.simulated);

  const TemporaryFolder folder{"invar-run"};  // where the processes leave their last words
  Beside beside{{options, cell, folder.path()}, {ServiceManager::from_environment(), folder.path()}};
  RestartNews restart_news{cell};
  if (!outcome.simulated)
    for (const auto& process : cell.processes)
      if (hosts.contains(process.host) && has_partner_on_another_pc(loaded, process.name))
        restart_news.be_ready(process);
  std::vector<Child> children;
  for (const auto& process : cell.processes)
    if (hosts.contains(process.host))
      children.push_back(spawn(options, process.name, outcome.simulated, folder.path()));

  if (outcome.simulated && !keeps_time(hosts, cell)) {
    for (; !stop && any_runs(children); sleep_a_little()) beside.look(children);
  } else if (outcome.simulated) {
    outcome.failure = keep_simulated_time(options, cell, children, stop, begin, beside, outcome);
  } else {
    while (!stop && (options.duration <= 0.0 || seconds_since(begin) < options.duration) &&
           (options.job.empty() ? keep_alive(children, options, cell, folder.path(), restart_news)
                                : !any_ended(children))) {
      beside.look(children);
      renew(children, options, cell, folder.path(), beside, stop);
      (void)follow_utc();  // as its processes do, for those that it starts again
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  beside.service.stopping();
  std::vector<bool> by_itself;
  for (const Child& child : children) by_itself.push_back(!child.running);
  if (!outcome.simulated) bring_to_rest(children, folder.path());
  stop_in_order(children, folder.path());
  for (std::size_t i = 0; i < children.size(); ++i) {
    const Child& child = children[i];
    outcome.processes.push_back({child.name, child.status, text_of(folder / (child.name + ".json"))});
    if (by_itself[i] && child.status != 0 && outcome.failure.empty())
      outcome.failure = "process `" + child.name + "` ended with status " + std::to_string(child.status);
    if (!by_itself[i] && child.status == 128 + SIGKILL && outcome.failure.empty())
      outcome.failure = "process `" + child.name + "` did not end within 10 s and was killed";
  }
  outcome.wall_seconds = seconds_since(begin);
  return outcome;
}

}  // namespace invar::tools
