// `invar run`: brings a cell up, keeps it running, runs a job, stops it in a safe order.
#include <signal.h>

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "core/base/clock.hpp"
#include "core/base/name.hpp"
#include "core/base/temporary_folder.hpp"
#include "core/dds/identity.hpp"
#include "tools/cell/launcher.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/cell/process.hpp"
#include "tools/cell/summary.hpp"
#include "tools/command.hpp"
#include "tools/keys/missing_rights.hpp"
#include "tools/live/job_progress.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

ProcessOrders orders;

void take_order(int signal) {
  (signal == SIGUSR1 ? orders.rest : signal == SIGUSR2 ? orders.renew : orders.stop) = true;
}

struct RunOptions {
  LaunchOptions launch;
  std::string process;
  std::filesystem::path outcome;
  pid_t launcher = 0;
  std::uint32_t restarts = 0;
  std::string last_end;
  std::int64_t stamps_ns = 0;
  bool simulated = false;
  bool real_time = false;
  bool json = false;
};

bool is_secured(const std::filesystem::path& file) {
  try {
    return read_structure(file)->security.has_value();
  } catch (const InputError&) {
    return false;  // said when the cell is loaded, with all that is wrong
  }
}

/// In a secured cell: says at once all that the certificates here lack, where a process would end at the first topic.
void check_rights(const std::filesystem::path& file, const std::string& process) {
  if (!is_secured(file)) return;
  LoadedCell loaded = load_cell(file);
  std::set<std::string> names;
  for (const auto& host : loaded.cell->hosts)
    if (process.empty()) names.insert(config::launcher_name(host.name));
  for (const auto& each : loaded.cell->processes)
    if (process.empty() || each.name == process) names.insert({each.name, dds::second_name(each.name)});
  if (const auto faults = missing_rights(loaded, names); !faults.empty()) throw InputError{faults};
}

/// One process, without a launcher.
int run_one(const RunOptions& options) {
  if (options.stamps_ns != 0) continue_stamps(Duration{options.stamps_ns});
  std::optional<TemporaryFolder> folder;  // for its last words, where only we want them
  std::filesystem::path outcome = options.outcome;
  if (options.json && outcome.empty()) outcome = folder.emplace("invar-run").path() / "outcome.json";
  const int status = run_process({.cell = options.launch.cell,
                                  .process = options.process,
                                  .simulated = options.simulated,
                                  .paced = options.launch.pace > 0.0,
                                  .job = options.launch.job,
                                  .outcome = outcome,
                                  .launcher = options.launcher,
                                  .restarts = options.restarts,
                                  .last_end = options.last_end},
                                 orders);
  if (options.json) std::cout << std::ifstream{outcome}.rdbuf();
  return status;
}

/// The text of a notice: names in it come over DDS, and nothing in them may steer a terminal.
class PrintableText final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string text = printable_lines({message.payload.data(), message.payload.size()});
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return spdlog::details::make_unique<PrintableText>();
  }
};

std::unique_ptr<spdlog::formatter> log_lines() {
  auto lines = std::make_unique<spdlog::pattern_formatter>();
  lines->add_flag<PrintableText>('*').set_pattern("[%Y-%m-%d %H:%M:%S.%e] [%n] [%^%l%$] %*");
  return lines;
}

int run(RunOptions& options) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("run"));  // stdout is the summary's
  spdlog::set_formatter(log_lines());
  options.launch.quiet = options.launch.quiet || options.json;
  if (options.launch.quiet) spdlog::set_level(spdlog::level::warn);
  struct sigaction action {};
  action.sa_handler = take_order;
  sigset_t taken;
  sigemptyset(&taken);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGUSR2}) {
    sigaction(signal, &action, nullptr);
    sigaddset(&taken, signal);
  }
  sigprocmask(SIG_UNBLOCK, &taken, nullptr);  // the launcher has us begin with them blocked
  if (options.simulated || options.real_time) options.launch.simulated = options.simulated;
  if (options.launcher == 0) check_rights(options.launch.cell, options.process);
  if (!options.process.empty()) return run_one(options);
  JobProgress progress;
  if (!options.launch.quiet)
    options.launch.progress = [&](double fraction, const std::string& text) {
      progress.show(fraction, text);
    };
  options.launch.renew = &orders.renew;
  const LaunchOutcome outcome = launch(options.launch, orders.stop);
  progress.end();
  std::ostringstream unseen;
  const auto json = summarise(outcome, options.json ? unseen : std::cout);
  if (options.json) std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  const bool well = json.at("healthy").get<bool>();
  if (!outcome.failure.empty())
    std::cerr << "invar run: " << outcome.failure << '\n';
  else if (!well)
    std::cerr << "invar run: not all was well at the end: " << json.at("faults").front().get<std::string>()
              << '\n';
  return well ? 0 : 1;
}

}  // namespace

void add_run(CLI::App& program) {
  auto* command = program.add_subcommand("run", "Run a cell: all its processes on this PC, or one of them");
  command->footer(
      "Example: invar run deployment/xy-table.yaml --job calibrate-geometry\n"
      "The progress of a job goes to the error output: one line kept current on a terminal, else one at each "
      "change.\n"
      "Ctrl-C stops the cell: every axis makes a controlled stop, then the processes end in the order of the "
      "file.\n"
      "SIGUSR2 starts the processes of a secured cell anew whose certificate was renewed, one after the "
      "other. Loops with a standby are handed over first.\n"
      "Notices of the cell, from warning up, go to the error output, a line each.\n"
      "Exit status: 0 all was well at the end; 2 the file has faults; 1 otherwise. Cases of 1: a job failed, "
      "a\n"
      "process ended by itself, an axis was in fault, a heater latched, a device silent, a model refused, or "
      "a recording cut");
  auto options = std::make_shared<RunOptions>();
  command->add_option("file", options->launch.cell, "the cell file")->required();
  command->add_option("--host", options->launch.host, "only the processes of this host");
  command->add_option("--process", options->process, "only this process, here and now (no children)");
  command->add_option("--job", options->launch.job, "run this job, then stop");
  command->add_option("--duration", options->launch.duration, "stop after this time of the cell [s]")
      ->check(positive());
  auto* simulated =
      command->add_flag("--simulated", options->simulated, "in simulated time, as fast as the CPU goes");
  command
      ->add_option("--pace", options->launch.pace,
                   "simulated time no faster than so many times the wall clock; `invar job` reaches it")
      ->check(positive());
  command->add_flag("--real-time", options->real_time, "by the wall clock")->excludes(simulated);
  command->add_flag("--json", options->json,
                    "print one JSON object at the end: processes, job, report, recordings; implies --quiet");
  command->add_flag("--quiet", options->launch.quiet, "no progress of the job, only what is wrong");
  command->add_option("--outcome", options->outcome, "with --process: leave what became of it here, as JSON");
  // For `invar run` alone.
  command->add_option("--launcher", options->launcher, "its process id")->group("");
  command->add_option("--restarts", options->restarts, "how often it started this process again")->group("");
  command
      ->add_option("--stamps", options->stamps_ns, "how far its stamps are ahead of the monotonic clock [ns]")
      ->group("");
  command->add_option("--last-end", options->last_end, "how the last life of this process ended")->group("");
  command->callback([options] {
    if (const int status = run(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools
