// How much the recorder takes: many channels at 1 kHz from several threads through RecordingWriter onto the disk; what
// was lost, what the writer's thread and the callers spend, how large the file is. Prints a table.
#include <sys/utsname.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <random>
#include <thread>

#include "core/recording/recording_reader.hpp"
#include "core/recording/recording_writer.hpp"

namespace {

using namespace invar;             // NOLINT: a program of one file
using namespace invar::recording;  // NOLINT

struct Load {
  std::size_t channels = 200, bytes = 500, threads = 4;
  double rate = 1000.0, seconds = 30.0;
};

double cpu_seconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

Instant now() {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return {time.tv_sec * 1'000'000'000 + time.tv_nsec};
}

/// Readings as machines send them: a stamp, slow motion, a few noisy bits at the end of each number.
void fill(Bytes& payload, std::uint64_t cycle, std::mt19937& random) {
  store(&payload[4], cycle * 1'000'000);
  for (std::size_t at = 16; at + 8 <= payload.size(); at += 8) {
    const double value = std::sin(1e-3 * static_cast<double>(cycle) + static_cast<double>(at)) +
                         1e-7 * static_cast<double>(random() % 1000);
    store(&payload[at], std::bit_cast<std::uint64_t>(value));
  }
}

struct Outcome {
  LossLedger ledger;
  RecordingStatus status;
  double wall = 0.0, callers_cpu = 0.0, process_cpu = 0.0;
  std::uint64_t behind = 0, calls = 0;  // cycles that a caller began more than one period late
};

/// Calls `write(channel, sequence, payload)` for every channel at the load's rate. Returns the callers' CPU time [s].
template <class Write>
double run_callers(const Load& load, std::atomic<std::uint64_t>& behind, Write write) {
  std::vector<std::thread> threads;
  std::vector<double> cpu(load.threads);
  const auto cycles = static_cast<std::uint64_t>(load.seconds * load.rate);
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t t = 0; t < load.threads; ++t)
    threads.emplace_back([&, t] {
      std::mt19937 random{static_cast<unsigned>(t)};
      // Every channel has samples of its own, which come again only after the chunk that holds them is packed.
      constexpr std::size_t variants = 16;
      std::vector<Bytes> payloads(load.channels * variants, Bytes(load.bytes));
      for (std::size_t i = t * variants; i < payloads.size(); ++i) fill(payloads[i], i, random);
      for (std::uint64_t cycle = 0; cycle < cycles; ++cycle) {
        const auto due = start + std::chrono::nanoseconds{
                                     static_cast<std::int64_t>(1e9 * static_cast<double>(cycle) / load.rate)};
        if (std::chrono::steady_clock::now() - due > std::chrono::duration<double>{1.0 / load.rate}) ++behind;
        std::this_thread::sleep_until(due);
        for (std::size_t channel = t; channel < load.channels; channel += load.threads) {
          Bytes& payload = payloads[channel * variants + cycle % variants];
          store(&payload[4], cycle * 1'000'000);
          write(channel, static_cast<std::uint32_t>(cycle + 1), payload);
        }
      }
      cpu[t] = cpu_seconds(CLOCK_THREAD_CPUTIME_ID);
    });
  for (auto& thread : threads) thread.join();
  double sum = 0.0;
  for (const double each : cpu) sum += each;
  return sum;
}

Outcome measure(const Load& load, Compression compression, const std::filesystem::path& file) {
  RecordingOptions options;
  options.chunks.compression = compression;
  Outcome outcome;
  const auto begin = std::chrono::steady_clock::now();
  const double cpu_begin = cpu_seconds(CLOCK_PROCESS_CPUTIME_ID);
  RecordingWriter writer{file, options};
  std::vector<std::uint16_t> ids;
  for (std::size_t i = 0; i < load.channels; ++i)
    ids.push_back(
        writer.add_channel({"cell/bench/" + std::to_string(i),
                            "bench::Sample",
                            "module bench { struct Sample { int64 time_ns; double values[61]; }; };",
                            "",
                            "",
                            {}}));
  std::atomic<std::uint64_t> behind{0};
  outcome.callers_cpu =
      run_callers(load, behind, [&](std::size_t channel, std::uint32_t sequence, const Bytes& payload) {
        const Instant time = now();
        writer.write(ids[channel], sequence, time, time, payload);
      });
  writer.close();
  outcome.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  outcome.process_cpu = cpu_seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu_begin;
  outcome.ledger = writer.ledger();
  outcome.status = writer.status();
  outcome.behind = behind;
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program{"Recorder under load"};
  Load load;
  std::filesystem::path folder = std::filesystem::temp_directory_path();
  program.add_option("--channels", load.channels, "channels (200)");
  program.add_option("--bytes", load.bytes, "bytes a sample (500)")->check(CLI::Range(16, 1 << 20));
  program.add_option("--threads", load.threads, "calling threads (4)");
  program.add_option("--rate", load.rate, "samples a second of each channel, in Hz (1000)");
  program.add_option("--seconds", load.seconds, "for how long, in s (30)");
  program.add_option("--folder", folder, "where the recordings go; they are removed again");
  CLI11_PARSE(program, argc, argv);

  utsname system{};
  uname(&system);
  std::printf(
      "%zu channels, %.0f Hz, %zu bytes: %.1f MB/s for %.0f s from %zu threads; %s %s, %ld CPUs, disk %s\n",
      load.channels, load.rate, load.bytes,
      static_cast<double>(load.channels * load.bytes) * load.rate * 1e-6, load.seconds, load.threads,
      system.sysname, system.release, sysconf(_SC_NPROCESSORS_ONLN), folder.c_str());
  std::atomic<std::uint64_t> behind{0};
  std::atomic<std::uint64_t> sink{0};
  Load base = load;
  base.seconds = std::min(load.seconds, 5.0);
  const double bare =
      run_callers(base, behind, [&](std::size_t, std::uint32_t sequence, const Bytes& payload) {
        sink += now().ns > 0 ? sequence + payload[4] : 0U;
      });
  std::printf("callers alone: %.1f %% of one CPU\n\n", 100.0 * bare / base.seconds);
  std::printf("%-6s %10s %10s %6s %8s %10s %9s %12s %12s %12s %10s\n", "packed", "arrived", "written", "lost",
              "missing", "file MB", "ratio", "queue MB", "writer CPU%", "callers CPU%", "late");
  bool nothing_lost = true;
  for (const auto compression : {Compression::lz4, Compression::zstd}) {
    const auto file = folder / ("invar-bench-" + std::to_string(getpid()) + ".mcap");
    const Outcome outcome = measure(load, compression, file);
    const auto total = outcome.ledger.total();
    const auto read = Recording::open(file).statistics().messages;
    const double megabytes = 1e-6 * static_cast<double>(outcome.status.bytes_written);
    const double handed = 1e-6 * static_cast<double>(total.arrived * load.bytes);
    std::printf("%-6s %10lu %10lu %6lu %8lu %10.1f %9.2f %12.1f %12.1f %12.1f %10lu\n",
                name_of(compression).data(), total.arrived, total.written, total.lost, total.missing,
                megabytes, handed / megabytes, 1e-6 * static_cast<double>(outcome.status.queue_peak),
                100.0 * (outcome.process_cpu - outcome.callers_cpu) / outcome.wall,
                100.0 * outcome.callers_cpu / outcome.wall, outcome.behind);
    std::fflush(stdout);
    nothing_lost = nothing_lost && total.lost == 0 && read == total.arrived;
    std::filesystem::remove(file);
  }
  std::printf("\n%s\n",
              nothing_lost ? "nothing lost: every sample handed over is in the file" : "SAMPLES WERE LOST");
  return nothing_lost ? 0 : 1;
}
