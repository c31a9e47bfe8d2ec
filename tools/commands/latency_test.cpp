// `invar latency-test`: how late this PC wakes a periodic loop, measured as the executor measures its own.
#include <sys/utsname.h>
#include <time.h>

#include <algorithm>
#include <exception>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/base/clock.hpp"
#include "core/executor/histogram.hpp"
#include "core/executor/pacer.hpp"
#include "core/executor/real_time.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct LatencyTestOptions {
  double rate = 1000.0;
  double duration = 10.0;
  int priority = 80;
  int cpu = -1;
  bool no_lock = false;
  bool json = false;
};

struct Measured {
  std::vector<Grant> grants;
  Histogram lateness;
  std::uint64_t cycles = 0, overruns = 0;
};

/// On a thread of its own, so that what it is granted ends with it.
void measure(const LatencyTestOptions& options, Measured& measured) {
  RealTimeRequest request;
  request.priority = options.priority;
  if (options.cpu >= 0) request.cpu = options.cpu;
  request.lock_memory = !options.no_lock;
  measured.grants = claim_real_time(request);
  touch_stack();
  const Duration period = Duration::seconds(1.0 / options.rate);
  const Instant start = monotonic_now() + Duration::milliseconds(10);
  const Instant end = start + Duration::seconds(options.duration);
  Pacer pacer{period, OverrunPolicy::skip, 0, start};
  while (pacer.due() < end && !interrupted()) {
    const Instant due = pacer.due();
    const timespec until{due.ns / 1'000'000'000, due.ns % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0 && !interrupted()) {
    }
    const Instant woken = monotonic_now();
    measured.lateness.add(woken - due);
    ++measured.cycles;
    pacer.wake(woken);
    pacer.finish(monotonic_now());
  }
  measured.overruns = pacer.overruns();
}

int latency_test(const LatencyTestOptions& options) {
  (void)interrupted();
  if (options.cpu >= static_cast<int>(std::thread::hardware_concurrency()))
    throw InputError{"--cpu", "this PC has no core " + std::to_string(options.cpu),
                     "use 0 to " + std::to_string(std::thread::hardware_concurrency() - 1)};
  const auto measured = std::make_unique<Measured>();
  std::thread{[&] { measure(options, *measured); }}.join();
  const HistogramCopy copy = measured->lateness.copy();
  constexpr double fractions[] = {0.5, 0.9, 0.99, 0.999, 0.9999};
  if (options.json) {
    nlohmann::ordered_json json{
        {"rate_hz", options.rate}, {"cycles", measured->cycles}, {"overruns", measured->overruns}};
    for (const double fraction : fractions)
      json["lateness_ns"][number_text(fraction * 100.0, 6)] = copy.quantile(fraction).ns;
    json["lateness_ns"]["max"] = copy.max.ns;
    json["not_granted"] = refusals(measured->grants);
    std::cout << json.dump(2) << '\n';
    return measured->cycles > 0 ? 0 : 1;
  }
  utsname system{};
  uname(&system);
  std::cout << "kernel " << system.release << " " << system.version << "; " << measured->cycles
            << " cycles at " << number_text(options.rate) << " Hz\n";
  for (const Grant& grant : measured->grants)
    std::cout << "  " << grant.what << ": " << (grant.granted ? "granted" : "not granted (" + grant.why + ")")
              << '\n';
  TextTable table{{"share of cycles [%]>", "late at most [us]>", "of a period [%]>"}};
  const auto add = [&](const std::string& share, Duration late) {
    table.add({share, microseconds_text(late.ns), number_text(late.in_seconds() * options.rate * 100.0, 3)});
  };
  for (const double fraction : fractions) add(number_text(fraction * 100.0, 6), copy.quantile(fraction));
  add("100", copy.max);
  table.print(std::cout);
  std::cout << measured->overruns << " overruns (woken a period or more too late)\n";
  return measured->cycles > 0 ? 0 : 1;
}

}  // namespace

void add_latency_test(CLI::App& program) {
  auto* command = program.add_subcommand("latency-test", "Measure how late this PC wakes a periodic loop");
  command->footer(
      "Example: invar latency-test --rate 1000 --duration 60 --priority 80 --cpu 1\n"
      "A loop that does nothing else: what remains is the system's. Run it under the load that the plant "
      "will have.\n"
      "Exit status: 0 measured, whatever came out; 1 not measured; 2 a fault of the call");
  auto options = std::make_shared<LatencyTestOptions>();
  command->add_option("--rate", options->rate, "rate of the loop [Hz] (1000)")
      ->check(CLI::Range(1.0, 50'000.0));
  command->add_option("--duration", options->duration, "[s] (10)")->check(CLI::Range(0.01, 1e6));
  command->add_option("--priority", options->priority, "SCHED_FIFO, 1 to 99; 0 for none (80)")
      ->check(CLI::Range(0, 99));
  command->add_option("--cpu", options->cpu, "pin the loop to this core")->check(CLI::Range(0, 4095));
  command->add_flag("--no-lock", options->no_lock, "do not lock memory");
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options] {
    if (const int result = latency_test(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
