// `invar run`: brings a cell up, keeps it running, runs a job, stops it in a safe order.
#include <signal.h>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <filesystem>
#include <iostream>
#include <memory>

#include "tools/cell/launcher.hpp"
#include "tools/cell/process.hpp"
#include "tools/cell/summary.hpp"
#include "tools/command.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

ProcessOrders orders;

void take_order(int signal) { (signal == SIGUSR1 ? orders.rest : orders.stop) = true; }

struct Options {
  LaunchOptions launch;
  std::string process;
  std::filesystem::path outcome;
  bool simulated = false;
  bool real_time = false;
};

int run(Options& options) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("run"));  // stdout is the summary's
  struct sigaction action {};
  action.sa_handler = take_order;
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaction(signal, &action, nullptr);
  if (options.simulated || options.real_time) options.launch.simulated = options.simulated;
  if (!options.process.empty())
    return run_process({.cell = options.launch.cell,
                        .process = options.process,
                        .simulated = options.simulated,
                        .paced = options.launch.pace > 0.0,
                        .job = options.launch.job,
                        .outcome = options.outcome},
                       orders);
  const LaunchOutcome outcome = launch(options.launch, orders.stop);
  summarise(outcome, std::cout);
  if (!outcome.failure.empty()) std::cerr << "invar run: " << outcome.failure << '\n';
  return outcome.failure.empty() ? 0 : 1;
}

}  // namespace

void add_run(CLI::App& program) {
  auto* command = program.add_subcommand("run", "Run a cell: all its processes on this PC, or one of them");
  command->footer(
      "Example: invar run deployment/xy-table.yaml --job calibrate-geometry\n"
      "Ctrl-C stops the cell: all that moves comes to rest first, then process by process in the order of "
      "the "
      "file. Exit status: 0 in order, 1 something failed, 2 the file has faults");
  auto options = std::make_shared<Options>();
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
  command->add_option("--outcome", options->outcome, "with --process: leave what became of it here, as JSON");
  command->callback([options] {
    if (const int status = run(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools
