// Writes many small topics as fast as asked from several threads, as `record.py` wants them: 200 of 500 bytes at 1 kHz are
// 100 MB/s. Prints one line of JSON: samples written and refused, CPU and wall-clock seconds.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <span>
#include <thread>

#include "core/dds/node.hpp"

namespace {

using namespace invar;  // NOLINT: a program of one file
using SteadyClock = std::chrono::steady_clock;

struct Load {
  std::size_t topics = 200, bytes = 500, threads = 2;
  double rate = 1000.0, seconds = 30.0;
};

struct Count {
  std::atomic<std::uint64_t> written{0}, refused{0};
};

/// Writes each `threads`-th topic from `first` on, all of them once a period.
void flood(std::vector<std::unique_ptr<dds::Connection>>& writers, const Load& load, std::size_t first,
           Count& count) {
  std::vector<std::byte> cdr(load.bytes);
  cdr[1] = std::byte{1};  // little endian
  const auto cycles = static_cast<std::uint64_t>(load.seconds * load.rate);
  const auto start = SteadyClock::now();
  for (std::uint64_t cycle = 0; cycle < cycles; ++cycle) {
    std::this_thread::sleep_until(start + std::chrono::nanoseconds{static_cast<std::int64_t>(
                                              1e9 * static_cast<double>(cycle) / load.rate)});
    std::memcpy(&cdr[4], &cycle, sizeof cycle);
    const std::span<const std::byte> sample{cdr};
    for (std::size_t i = first; i < writers.size(); i += load.threads)
      ++(writers[i]->write(&sample) ? count.written : count.refused);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program{"Many topics at once"};
  Load load;
  std::uint32_t domain = 0;
  std::string profile = "command";
  program.add_option("--domain", domain, "DDS domain")->required();
  program.add_option("--topics", load.topics, "topics (200)");
  program.add_option("--bytes", load.bytes, "bytes a sample (500)")->check(CLI::Range(16, 1 << 20));
  program.add_option("--threads", load.threads, "writing threads (2)");
  program.add_option("--rate", load.rate, "samples a second of each topic, in Hz (1000)");
  program.add_option("--seconds", load.seconds, "for how long, in s (30)");
  program.add_option("--profile", profile, "QoS profile (command: reliable, the last 200 kept)");
  CLI11_PARSE(program, argc, argv);

  dds::NodeOptions options;
  options.domain = domain;
  options.cell = "flood";
  options.process = "flood";
  options.addresses = {"127.0.0.1"};
  dds::Node node{options, dds::standard_profiles()};
  dds::Profile qos = node.profile(profile);
  qos.lifespan = {};
  qos.lease = {};
  qos.liveliness = dds::Liveliness::automatic;
  qos.exclusive = false;
  std::vector<std::unique_ptr<dds::Connection>> writers;
  for (std::size_t i = 0; i < load.topics; ++i)
    writers.push_back(node.raw_writer("cell/flood/" + std::to_string(i), "bench::Sample", qos));
  const auto patience = SteadyClock::now() + std::chrono::seconds{30};
  for (const auto& writer : writers)
    while (writer->matched() == 0 && SteadyClock::now() < patience)
      std::this_thread::sleep_for(std::chrono::milliseconds{10});

  Count count;
  const auto begin = SteadyClock::now();
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < load.threads; ++t)
    threads.emplace_back([&, t] { flood(writers, load, t, count); });
  for (auto& thread : threads) thread.join();
  const std::chrono::duration<double> wall = SteadyClock::now() - begin;
  for (const auto& writer : writers) (void)writer->wait_for_acknowledgments(Duration::milliseconds(2000));
  timespec cpu{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
  std::printf("{\"written\": %lu, \"refused\": %lu, \"wall\": %.2f, \"cpu\": %.2f}\n", count.written.load(),
              count.refused.load(), wall.count(),
              static_cast<double>(cpu.tv_sec) + 1e-9 * static_cast<double>(cpu.tv_nsec));
}
