// Latency of samples between two processes, in turns in one run: through our ports from an executor's loop, with bare
// Fast DDS of the same QoS, with Cyclone DDS; and the loop's stream beside calibration traffic as fast as it can go.
#include <pthread.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <new>
#include <thread>

#include "core/dds/bell.hpp"
#include "core/dds/node.hpp"
#include "core/dds/participant.hpp"
#include "core/dds/shared_file.hpp"
#include "core/executor/executor.hpp"
#include "cyclone_channel.h"
#include "idl/types.hpp"

namespace invar {
namespace {

struct Settings {
  double seconds = 30.0;
  double rate = 1000.0;
  int priority = 80;  // of the loops; the middleware's threads have 10 less
  int cpu = -1;
  bool shared_memory = true;
  bool separation = false;
  std::int64_t start_ns = 0;  // both processes count turns from here
};

constexpr Duration turn_length = Duration::milliseconds(1000);
/// What is sent in a turn; the two orders alternate so that none is always first.
enum Kind { ours, bare, cyclone, futex, quiet, separated, together_quiet, together };
constexpr std::array latency_kinds{ours, bare, cyclone, futex};
constexpr std::array separation_kinds{quiet, separated, together_quiet, together};
constexpr std::array names{"Invar ports",
                           "bare Fast DDS",
                           "Cyclone DDS (UDP)",
                           "bare futex wake-up",
                           "alone",
                           "beside calibration",
                           "one participant and profile: alone",
                           "one participant and profile: beside calibration"};

template <std::size_t N>
Kind pick(const std::array<Kind, N>& kinds, std::int64_t turn) {
  const auto i = static_cast<std::size_t>(turn) % N, round = static_cast<std::size_t>(turn) / N;
  return kinds[round % 2 == 0 ? i : N - 1 - i];
}

/// The kind of the turn at a time; nothing in the first and last 50 ms of a turn, and outside of the run.
std::optional<Kind> kind_at(const Settings& s, Instant now) {
  const std::int64_t since = now.ns - s.start_ns, within = since % turn_length.ns;
  if (since < 0 || since > static_cast<std::int64_t>(s.seconds * 1e9)) return std::nullopt;
  if (within < 50'000'000 || within > turn_length.ns - 50'000'000) return std::nullopt;
  return s.separation ? pick(separation_kinds, since / turn_length.ns)
                      : pick(latency_kinds, since / turn_length.ns);
}

std::uint32_t domain() { return 11; }

dds::NodeOptions options(const Settings& s, const std::string& process) {
  dds::NodeOptions o;
  o.cell = "bench";
  o.process = process;
  o.domain = domain();
  o.addresses = {"127.0.0.1"};
  o.shared_memory = s.shared_memory;
  o.realtime_priority = s.priority > 10 ? s.priority - 10 : 0;
  if (s.cpu >= 0) o.realtime_cpu = s.cpu;
  return o;
}

void set_priority(int priority) {
  sched_param p{};
  p.sched_priority = priority;
  if (priority > 0 && pthread_setschedparam(pthread_self(), SCHED_FIFO, &p) != 0)
    std::cerr << "SCHED_FIFO is not allowed here: all run with the usual scheduling\n";
}

/// The realtime profile on the participant of everything else, for the comparison.
dds::Profile mixed_profile() {
  dds::Profile p = dds::standard_profiles().at("realtime");
  p.traffic = dds::Traffic::general;
  return p;
}

/// Writes the moment of writing, in the turns of ours.
class Sender final : public Component {
 public:
  explicit Sender(const Settings& s) : settings_{s} {}
  Output<stage::AxisState> out{*this, "out"};
  Output<stage::AxisState> mixed{*this, "mixed"};
  void step(const Tick& tick) noexcept override {
    const auto kind = kind_at(settings_, monotonic_now());
    if (!kind) return;
    stage::AxisState sample;
    sample.at().cycle(tick.cycle);
    sample.at().time_ns(monotonic_now().ns);
    if (*kind == ours || *kind == quiet || *kind == separated) out.write(sample);
    if (*kind == together_quiet || *kind == together) mixed.write(sample);
  }

 private:
  const Settings& settings_;
};

/// The limit: a word in shared memory and a thread that sleeps on it. The newest moment of writing lies beside the bell.
struct BareWord {
  dds::Bell bell;
  std::atomic<std::int64_t> sent_ns{0};
};
std::string bare_name(const Settings& s) { return "bench_" + std::to_string(s.start_ns); }

/// A rival's loop: sleeps to absolute times and sends in its turns.
void rival_loop(const Settings& s, Kind mine, const std::function<void(std::int64_t)>& send) {
  if (s.cpu >= 0) {
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(static_cast<std::size_t>(s.cpu), &cores);
    pthread_setaffinity_np(pthread_self(), sizeof cores, &cores);
  }
  set_priority(s.priority);
  prctl(PR_SET_TIMERSLACK, 1);
  const auto period = static_cast<std::int64_t>(1e9 / s.rate);
  const std::int64_t end = s.start_ns + static_cast<std::int64_t>(s.seconds * 1e9);
  for (std::int64_t due = s.start_ns; due < end; due += period) {
    const timespec at{due / 1'000'000'000, due % 1'000'000'000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
    if (kind_at(s, {due}) == mine) send(monotonic_now().ns);
  }
}

int send(const Settings& s) {
  mlockall(MCL_CURRENT);
  dds::Node node{options(s, "sender"), dds::standard_profiles()};
  auto component = std::make_unique<Sender>(s);
  Sender& sender = *component;
  sender.out.topic = "ours";
  sender.mixed.topic = "mixed";
  ExecutorOptions loop;
  loop.process = "sender";
  loop.period = Duration::seconds(1.0 / s.rate);
  if (s.priority > 0)
    loop.real_time = RealTimeRequest{.priority = s.priority,
                                     .cpu = s.cpu >= 0 ? std::optional{s.cpu} : std::nullopt,
                                     .lock_memory = true,
                                     .require = false};
  Executor executor{loop};
  executor.add(std::move(component));
  node.bind(sender.out, {loop.period, {}});
  node.bind(sender.mixed, {loop.period, {}}, mixed_profile());
  executor.at_cycle_end([&] { node.cycle_ended(); });
  node.start();
  executor.start();
  executor.transition(0, Transition::configure);
  executor.transition(0, Transition::activate);

  std::vector<std::thread> others;
  dds::Discovery discovery;
  std::unique_ptr<dds::Participant> participant;
  if (s.separation) {
    others.emplace_back([&] {  // calibration: readings as fast as the middleware takes them
      auto apart = node.writer<sensing::DisplacementReading>("calibration", "calibration");
      auto mixed = node.writer<sensing::DisplacementReading>("calibration_mixed", mixed_profile());
      sensing::DisplacementReading reading;
      while (monotonic_now().ns < s.start_ns + static_cast<std::int64_t>(s.seconds * 1e9)) {
        const auto kind = kind_at(s, monotonic_now());
        if (kind == separated)
          apart.write(reading);
        else if (kind == together)
          mixed.write(reading);
        else
          std::this_thread::sleep_for(std::chrono::milliseconds{1});
      }
    });
  } else {
    others.emplace_back([&] {
      participant = std::make_unique<dds::Participant>(options(s, "bare-sender"), dds::Traffic::realtime,
                                                       dds::standard_profiles(), discovery);
      auto& writer = participant->create_writer("bare", new stage::AxisStatePubSubType,
                                                dds::standard_profiles().at("realtime"));
      stage::AxisState sample;
      rival_loop(s, bare, [&](std::int64_t now) {
        sample.at().time_ns(now);
        writer.write(&sample);
      });
    });
    others.emplace_back([&] {
      set_priority(s.priority > 10 ? s.priority - 10 : 0);  // for the threads that it makes
      if (cyclone_open_writer(domain()) != 0) std::cerr << "Cyclone DDS could not open its writer\n";
      rival_loop(s, cyclone, cyclone_write);
    });
    others.emplace_back([&] {
      const auto file = dds::SharedFile::open(bare_name(s));
      if (!file) return;
      auto& word = *std::launder(reinterpret_cast<BareWord*>(file->data()));
      rival_loop(s, futex, [&](std::int64_t now) {
        word.sent_ns = now;
        dds::ring(word.bell);
      });
    });
  }
  for (auto& other : others) other.join();
  executor.stop();
  node.stop();
  return 0;
}

/// Latencies of one kind, turn by turn.
class Board {
 public:
  explicit Board(const Settings& s) : settings_{s} {}
  void take(std::int64_t sent_ns, Kind fixed) {
    const auto kind = kind_at(settings_, {sent_ns});
    if (!kind) return;
    const Kind row = settings_.separation ? *kind : fixed;
    const Duration took = monotonic_now() - Instant{sent_ns};
    const std::lock_guard lock{mutex_};
    auto& turns = rows_[static_cast<std::size_t>(row)];
    turns[(sent_ns - settings_.start_ns) / turn_length.ns].push_back(took.ns);
  }
  struct Figures {
    std::size_t count = 0;
    double p50 = 0, p99 = 0, p999 = 0, max = 0;
    std::vector<double> turn_p50, turn_p99;
  };
  [[nodiscard]] Figures figures(Kind kind) {
    const std::lock_guard lock{mutex_};
    Figures f;
    std::vector<std::int64_t> all;
    for (auto& [turn, values] : rows_[static_cast<std::size_t>(kind)]) {
      std::sort(values.begin(), values.end());
      f.turn_p50.push_back(at(values, 0.5));
      f.turn_p99.push_back(at(values, 0.99));
      all.insert(all.end(), values.begin(), values.end());
    }
    if (all.empty()) return f;
    std::sort(all.begin(), all.end());
    f.count = all.size();
    f.p50 = at(all, 0.5), f.p99 = at(all, 0.99), f.p999 = at(all, 0.999), f.max = at(all, 1.0);
    return f;
  }
  /// Microseconds.
  static double at(const std::vector<std::int64_t>& sorted, double fraction) {
    const auto i = static_cast<std::size_t>(fraction * static_cast<double>(sorted.size() - 1));
    return static_cast<double>(sorted[i]) * 1e-3;
  }

 private:
  const Settings& settings_;
  std::mutex mutex_;
  std::array<std::map<std::int64_t, std::vector<std::int64_t>>, names.size()> rows_;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Median over the pairs of neighbouring turns.
double turn_ratio(const std::vector<double>& of, const std::vector<double>& over) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(of.size(), over.size()); ++i) ratios.push_back(of[i] / over[i]);
  return median(ratios);
}

class BareReader final : public eprosima::fastdds::dds::DataReaderListener {
 public:
  explicit BareReader(Board& board) : board_{board} {}
  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override {
    eprosima::fastdds::dds::SampleInfo info;
    while (reader->read_next_sample(&sample_, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
      if (info.valid_data) board_.take(sample_.at().time_ns(), bare);
  }

 private:
  Board& board_;
  stage::AxisState sample_;
};

/// Receives from the bare word until the run is over.
void watch_bare_word(const Settings& s, BareWord& word, Board& board) {
  set_priority(s.priority > 10 ? s.priority - 10 : 0);
  prctl(PR_SET_TIMERSLACK, 1);
  for (std::int64_t last = 0; monotonic_now().ns < s.start_ns + static_cast<std::int64_t>(s.seconds * 1e9);) {
    const std::uint32_t rung = word.bell.rung;
    const std::int64_t sent = word.sent_ns;
    if (sent == last)
      dds::sleep_on(word.bell, rung, Duration::milliseconds(500));
    else
      board.take(last = sent, futex);
  }
}

/// Nanoseconds that the threads of a process have run.
std::int64_t cpu_time(pid_t pid) {
  std::int64_t sum = 0;
  std::error_code error;
  for (const auto& task :
       std::filesystem::directory_iterator{"/proc/" + std::to_string(pid) + "/task", error}) {
    std::int64_t ran = 0;
    std::ifstream{task.path() / "schedstat"} >> ran;
    sum += ran;
  }
  return sum;
}

/// The share of a core that both processes take in the turns of each kind.
class CpuShares {
 public:
  CpuShares(const Settings& s, pid_t other) : settings_{s}, other_{other}, thread_{[this] { run(); }} {}
  ~CpuShares() { thread_.join(); }
  double percent(Kind kind) {
    const auto& [ran, wall] = times_[static_cast<std::size_t>(kind)];
    return wall == 0 ? 0.0 : 100.0 * static_cast<double>(ran) / static_cast<double>(wall);
  }

 private:
  void run() {
    const std::int64_t turns = static_cast<std::int64_t>(settings_.seconds * 1e9) / turn_length.ns;
    for (std::int64_t turn = 0; turn < turns; ++turn) {
      const Instant begin{settings_.start_ns + turn * turn_length.ns + 60'000'000};
      wait_until(begin);
      const auto before = cpu_time(getpid()) + cpu_time(other_);
      wait_until(begin + turn_length - Duration::milliseconds(120));
      const auto kind = kind_at(settings_, begin);
      if (!kind) continue;
      auto& [ran, wall] = times_[static_cast<std::size_t>(*kind)];
      ran += cpu_time(getpid()) + cpu_time(other_) - before;
      wall += turn_length.ns - 120'000'000;
    }
  }
  static void wait_until(Instant at) {
    std::this_thread::sleep_for(
        std::chrono::nanoseconds{std::max<std::int64_t>(0, at.ns - monotonic_now().ns)});
  }
  const Settings& settings_;
  pid_t other_;
  std::array<std::pair<std::int64_t, std::int64_t>, names.size()> times_{};
  std::thread thread_;
};

void print(const Settings& s, Board& board, CpuShares& cpu) {
  std::cout
      << "| | samples | p50 us | p99 us | p99.9 us | max us | p50 ratio | p99 ratio | CPU % of a core |\n"
      << "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
      << std::fixed;
  const auto row = [&](Kind kind, Kind over) {
    const auto f = board.figures(kind), base = board.figures(over);
    std::cout << std::setprecision(1) << "| " << names[static_cast<std::size_t>(kind)] << " | " << f.count
              << " | " << f.p50 << " | " << f.p99 << " | " << f.p999 << " | " << f.max << " | "
              << std::setprecision(2) << turn_ratio(f.turn_p50, base.turn_p50) << " | "
              << turn_ratio(f.turn_p99, base.turn_p99) << " | " << std::setprecision(1) << cpu.percent(kind)
              << " |\n";
  };
  if (s.separation) {
    row(quiet, quiet), row(separated, quiet), row(together_quiet, together_quiet),
        row(together, together_quiet);
    std::cout << "\nRatios: over the same stream alone, median over neighbouring turns of 1 s.\n";
  } else {
    row(ours, cyclone), row(bare, cyclone), row(cyclone, cyclone), row(futex, cyclone);
    std::cout << "\nRatios: over Cyclone DDS, median over neighbouring turns of 1 s. CPU: both processes "
                 "together.\n";
  }
}

int receive(Settings s, const std::string& self) {
  const int middleware = s.priority > 10 ? s.priority - 10 : 0;
  s.start_ns = (monotonic_now().ns / 1'000'000'000 + 4) * 1'000'000'000;  // time to find each other
  std::vector<std::string> words{self,
                                 "--send",
                                 std::to_string(s.start_ns),
                                 "--seconds",
                                 std::to_string(s.seconds),
                                 "--rate",
                                 std::to_string(s.rate),
                                 "--priority",
                                 std::to_string(s.priority),
                                 "--cpu",
                                 std::to_string(s.cpu)};
  if (!s.shared_memory) words.emplace_back("--udp");
  if (s.separation) words.emplace_back("--separation");
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const auto bare_file = dds::SharedFile::make(bare_name(s), sizeof(BareWord));
  if (!bare_file) return 1;
  auto& bare_word = *new (bare_file->data()) BareWord;
  pid_t pid = 0;
  if (posix_spawn(&pid, "/proc/self/exe", nullptr, nullptr, arguments.data(), environ) != 0) return 1;

  Board board{s};
  dds::Node node{options(s, "receiver"), dds::standard_profiles()};
  const auto take = [&](const stage::AxisState& sample) { board.take(sample.at().time_ns(), ours); };
  const auto reader = node.reader<stage::AxisState>("ours", "realtime", take);
  const auto mixed = node.reader<stage::AxisState>("mixed", mixed_profile(), take);
  std::atomic<std::uint64_t> apart_count{0}, mixed_count{0};
  std::unique_ptr<dds::Connection> apart_reader, mixed_reader;
  BareReader bare_reader{board};
  dds::Discovery discovery;
  std::unique_ptr<dds::Participant> participant;
  if (s.separation) {
    apart_reader = node.reader<sensing::DisplacementReading>("calibration", "calibration",
                                                             [&](const auto&) { ++apart_count; });
    mixed_reader = node.reader<sensing::DisplacementReading>("calibration_mixed", mixed_profile(),
                                                             [&](const auto&) { ++mixed_count; });
  } else {
    participant = std::make_unique<dds::Participant>(options(s, "bare-receiver"), dds::Traffic::realtime,
                                                     dds::standard_profiles(), discovery);
    (void)participant->create_reader("bare", new stage::AxisStatePubSubType,
                                     dds::standard_profiles().at("realtime"), &bare_reader);
    std::thread{[&] {
      set_priority(middleware);
      if (cyclone_open_reader(
              domain(), [](std::int64_t sent, void* to) { static_cast<Board*>(to)->take(sent, cyclone); },
              &board) != 0)
        std::cerr << "Cyclone DDS could not open its reader\n";
    }}.join();
  }
  std::thread bare_watcher{[&] { watch_bare_word(s, bare_word, board); }};
  CpuShares cpu{s, pid};
  int status = 0;
  waitpid(pid, &status, 0);
  bare_watcher.join();
  print(s, board, cpu);
  if (s.separation)
    std::cout << "Calibration readings received: " << apart_count << " apart, " << mixed_count
              << " on one participant.\n";
  return status;
}

}  // namespace

int bench(int argc, char** argv) {
  // Cyclone DDS has no discovery on lo unless told that it can multicast.
  setenv("CYCLONEDDS_URI",
         "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" "
         "multicast=\"true\"/></Interfaces>"
         "</General></Domain></CycloneDDS>",
         0);
  Settings s;
  bool udp = false;
  CLI::App program{
      "Latency between two processes through our ports and through rivals, and beside other traffic."};
  program.add_option("--seconds", s.seconds, "length of the run")->capture_default_str();
  program.add_option("--rate", s.rate, "samples a second")->capture_default_str();
  program.add_option("--priority", s.priority, "SCHED_FIFO priority of the loops; 0: usual scheduling")
      ->capture_default_str();
  program.add_option("--cpu", s.cpu, "core of the loops; -1: any")->capture_default_str();
  program.add_flag("--udp", udp, "without shared memory");
  program.add_flag("--separation", s.separation, "the stream beside calibration traffic");
  program.add_option("--send", s.start_ns)->group("");
  CLI11_PARSE(program, argc, argv);
  s.shared_memory = !udp;
  return s.start_ns != 0 ? send(s) : receive(s, argv[0]);
}

}  // namespace invar

int main(int argc, char** argv) { return invar::bench(argc, argv); }
