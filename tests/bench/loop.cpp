// The executor's loop beside a bare clock_nanosleep loop of the same priority on the same core, in turns within one
// run: how late they wake, how long the work takes, how many periods are lost. Prints a table; no test.
#include <sys/utsname.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/executor/process_control.hpp"

namespace {

using namespace invar;

/// 64 bytes, as the loop's signals are.
struct Sample {
  std::uint64_t stamp = 0, cycle = 0;
  std::array<double, 6> values{};
};

/// A second-order filter on six values: about what a servo computes.
class Stage final : public Component {
 public:
  Input<Sample> in{*this, "in", {.deadline = Duration::seconds(10.0)}};
  Output<Sample> out{*this, "out"};
  void step(const Tick& tick) noexcept override {
    Sample sample{static_cast<std::uint64_t>(tick.now.ns), tick.cycle, {}};
    if (const Sample* newest = in.latest()) sample.values = newest->values;
    for (std::size_t i = 0; i < 6; ++i) {
      velocity_[i] += tick.period * (100.0 * (sample.values[i] + 1.0 - position_[i]) - 20.0 * velocity_[i]);
      sample.values[i] = position_[i] += tick.period * velocity_[i];
    }
    out.write(sample);
  }

 private:
  std::array<double, 6> position_{}, velocity_{};
};

constexpr Duration warm_up = Duration::milliseconds(50);  // of each turn, not counted

struct Block {
  HistogramCopy wake_up, compute;
  std::uint64_t overruns = 0;
  void add(const Block& other) {
    wake_up.add(other.wake_up);
    compute.add(other.compute);
    overruns += other.overruns;
  }
};

Instant monotonic() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return {std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec};
}

Block run_bare(const ExecutorOptions& options, double seconds) {
  auto block = std::make_unique<Block>();
  std::thread thread{[&] {
    (void)claim_real_time(*options.real_time);
    const std::int64_t period = options.period.ns;
    Pacer pacer{options.period, OverrunPolicy::skip, 0, {(monotonic().ns / period + 2) * period}};
    const Instant begin = monotonic() + warm_up;
    const Instant end = begin + Duration::seconds(seconds);
    std::uint64_t before = 0;
    while (pacer.due() < end) {
      const Instant due = pacer.due();
      const timespec t{due.ns / 1'000'000'000, due.ns % 1'000'000'000};
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
      const Instant woke = monotonic();
      pacer.wake(woke);
      pacer.finish(monotonic());
      if (due < begin) {
        before = pacer.overruns();
      } else {
        block->wake_up.add(woke - due);
      }
    }
    block->overruns = pacer.overruns() - before;
  }};
  thread.join();
  return *block;
}

Block run_executor(const ExecutorOptions& options, double seconds, int components, bool hammer) {
  Executor executor{options};
  std::vector<Stage*> stages;
  for (int i = 0; i < components; ++i) {
    auto stage = std::make_unique<Stage>();
    stage->name = "stage" + std::to_string(i);
    if (!stages.empty()) stages.back()->out.connect(stage->in);
    stages.push_back(stage.get());
    executor.add(std::move(stage), {"stage", {}, nullptr, 1});
  }
  stages.back()->out.connect(stages.front()->in);
  ProcessControl control{executor};
  (void)control.request("all", Transition::configure);
  (void)control.request("all", Transition::activate);
  executor.start();
  std::this_thread::sleep_for(std::chrono::nanoseconds{warm_up.ns});
  control.clear_statistics();
  const std::uint64_t before = executor.counters().overruns;
  const Instant end = monotonic() + Duration::seconds(seconds);
  while (monotonic() < end) {
    if (hammer) {
      (void)control.status();
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
  }
  executor.stop();
  return {executor.wake_up(), executor.compute(), executor.counters().overruns - before};
}

double us(Duration d) { return static_cast<double>(d.ns) * 1e-3; }

void print_row(int rate, const char* what, const HistogramCopy& histogram, const Block& block) {
  const Percentiles p = histogram.percentiles();
  std::printf("%6d  %-16s %9llu %9.2f %9.2f %9.2f %10.1f %9llu\n", rate, what,
              static_cast<unsigned long long>(p.count), us(p.p50), us(p.p99), us(p.p999), us(p.max),
              static_cast<unsigned long long>(block.overruns));
}

struct Spread {
  double lower, median, upper;
};
Spread spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double q) {
    const double place = q * static_cast<double>(values.size() - 1);
    const auto below = static_cast<std::size_t>(place);
    const std::size_t above = std::min(below + 1, values.size() - 1);
    return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
  };
  return {at(0.25), at(0.5), at(0.75)};
}

void print_conditions(const ExecutorOptions& options, double seconds, double block, int components,
                      bool hammer) {
  utsname host{};
  uname(&host);
  std::string line, cpu = "unknown CPU";
  for (std::ifstream info{"/proc/cpuinfo"}; std::getline(info, line);)
    if (line.starts_with("model name")) cpu = line.substr(line.find(':') + 2);
  std::string load;
  std::getline(std::ifstream{"/proc/loadavg"}, load);
  std::printf("%s, %u cores, kernel %s %s\n", cpu.c_str(), std::thread::hardware_concurrency(), host.release,
              host.version);
  std::printf("load before: %s; %.0f s each, in turns of %.1f s; %d components; %s\n", load.c_str(), seconds,
              block, components, hammer ? "status read without pause meanwhile" : "nobody looks meanwhile");
  std::vector<Grant> grants;
  std::thread{[&] { grants = claim_real_time(*options.real_time); }}.join();
  for (const Grant& g : grants)
    std::printf("%s: %s\n", g.what.c_str(), g.granted ? "granted" : g.why.c_str());
  std::printf("\n%6s  %-16s %9s %9s %9s %9s %10s %9s\n", "Hz", "", "count", "p50 us", "p99 us", "p99.9 us",
              "max us", "overruns");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The executor's loop beside a bare clock_nanosleep loop, in turns."};
  double seconds = 10.0, block = 1.0;
  int components = 8, priority = 80, cpu = -1;
  std::vector<int> rates{1000, 4000, 10000};
  bool hammer = false;
  app.add_option("--seconds", seconds, "seconds for each loop at each rate")->capture_default_str();
  app.add_option("--block", block, "seconds of one turn")->capture_default_str();
  app.add_option("--rates", rates, "in Hz")->delimiter(',');
  app.add_option("--components", components, "components in the loop")->capture_default_str();
  app.add_option("--priority", priority, "of SCHED_FIFO; 0: usual scheduling")->capture_default_str();
  app.add_option("--cpu", cpu, "the core of both loops; -1: any")->capture_default_str();
  app.add_flag("--hammer", hammer, "read the status without pause meanwhile");
  CLI11_PARSE(app, argc, argv);

  ExecutorOptions options;
  options.process = "bench";
  options.real_time = RealTimeRequest{priority, cpu < 0 ? std::nullopt : std::optional{cpu}, true, false};
  print_conditions(options, seconds, block, components, hammer);
  for (const int rate : rates) {
    options.period = {1'000'000'000 / rate};
    auto bare = std::make_unique<Block>(), ours = std::make_unique<Block>();
    std::vector<double> ratio_p50, ratio_p99;
    const int turns = std::max(1, static_cast<int>(seconds / block + 0.5));
    for (int turn = 0; turn < turns; ++turn) {
      Block one[2];  // who goes first changes, so that a slow drift of the host meets both
      for (const int which : {turn % 2, 1 - turn % 2})
        one[which] = which == 0 ? run_bare(options, block) : run_executor(options, block, components, hammer);
      bare->add(one[0]);
      ours->add(one[1]);
      const Percentiles b = one[0].wake_up.percentiles(), o = one[1].wake_up.percentiles();
      ratio_p50.push_back(us(o.p50) / us(b.p50));
      ratio_p99.push_back(us(o.p99) / us(b.p99));
    }
    print_row(rate, "bare wake-up", bare->wake_up, *bare);
    print_row(rate, "Invar wake-up", ours->wake_up, *ours);
    print_row(rate, "Invar compute", ours->compute, *ours);
    const Spread p50 = spread(ratio_p50), p99 = spread(ratio_p99);
    std::printf(
        "        ratio of wake-up, median (quartiles) of the turns: p50 %.2f (%.2f..%.2f), p99 %.2f "
        "(%.2f..%.2f)\n",
        p50.median, p50.lower, p50.upper, p99.median, p99.lower, p99.upper);
  }
  return 0;
}
