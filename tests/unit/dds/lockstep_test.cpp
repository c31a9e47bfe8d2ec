// Simulated time over three processes: this program is also the one that they run.
#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/wait.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/dds/simulated_clock.hpp"
#include "domain.hpp"
#include "idl/types.hpp"
#include "tests/support/temporary_folder.hpp"

extern char** environ;

namespace invar::dds {
namespace {

/// Each process steps this: its output depends on all that it ever received, in the order received, so that any
/// difference in delivery changes every later value.
class Mixer final : public Component {
 public:
  explicit Mixer(std::uint32_t number) : number_{number} {}
  Input<stage::AxisState> left{*this, "left"};
  Inbox<stage::AxisCommand> right{*this, "right"};
  Output<stage::AxisState> state{*this, "state"};
  Output<stage::AxisCommand> command{*this, "command", "command"};

  void step(const Tick& tick) noexcept override {
    set_now(tick.now);
    if (const auto* newest = left.latest()) mix(newest->at().cycle());
    for (stage::AxisCommand taken; right.take(taken);) mix(taken.id());
    stage::AxisState sample;
    sample.axis(number_);
    sample.at().cycle(hash_);
    state.write(sample);
    if (tick.cycle % 3 == number_ % 3) {
      stage::AxisCommand order;
      order.id(hash_ ^ tick.cycle);
      command.write(order);
    }
  }
  [[nodiscard]] std::uint64_t hash() const { return hash_; }

 private:
  void mix(std::uint64_t value) { hash_ = (hash_ ^ value) * 0x9E3779B97F4A7C15U + (hash_ >> 29U); }
  std::uint32_t number_;
  std::uint64_t hash_ = 0x1234567;
};

const std::vector<std::string> names{"one", "two", "three"};

/// The life of one process; writes its final hash, and a hash of all that its tap saw.
int child(const std::string& name, std::uint32_t number, std::uint32_t domain, const std::string& file) {
  NodeOptions options = testing::local(name);
  options.domain = domain;
  Node node{options, standard_profiles()};
  Mixer mixer{number};
  mixer.state.topic = "cell/test/" + name + "/state";
  mixer.command.topic = "cell/test/" + name + "/command";
  mixer.left.topic = "cell/test/" + names[(number + 1) % 3] + "/state";
  mixer.right.topic = "cell/test/" + names[(number + 2) % 3] + "/command";
  SimulatedClockClient client{node};
  client.bind(mixer.state);
  client.bind(mixer.command);
  client.bind(mixer.left);
  client.bind(mixer.right);
  std::uint64_t seen = 0, count = 0;
  if (number == 0)
    client.tap([&](const LockstepSample& sample) {
      for (const auto byte : sample.cdr) seen = (seen ^ static_cast<std::uint64_t>(byte)) * 1099511628211U;
      seen ^= name_number(sample.process) + name_number(sample.topic.topic) + sample.sequence;
      ++count;
    });
  std::uint64_t cycle = 0;
  const std::atomic<bool> stop{false};
  const auto run = client.run(
      [&](Instant until) {
        for (; static_cast<std::int64_t>(cycle) * 1'000'000 < until.ns; ++cycle)
          mixer.step({{static_cast<std::int64_t>(cycle) * 1'000'000}, 1e-3, cycle});
        return std::string{};
      },
      [&] { return cycle >= 3000; }, stop, Duration::milliseconds(30'000));
  std::ofstream{file} << mixer.hash() << ' ' << seen << ' ' << count << ' ' << run.failure;
  return run.ended ? 0 : 1;
}

class Processes {
 public:
  explicit Processes(const std::filesystem::path& folder) : folder_{folder} {
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string number = std::to_string(i), domain = std::to_string(testing::test_domain());
      const std::string file = (folder_ / names[i]).string();
      std::vector<std::string> words{"test", "--lockstep-process", names[i], number, domain, file};
      std::vector<char*> arguments;
      for (auto& word : words) arguments.push_back(word.data());
      arguments.push_back(nullptr);
      pid_t pid = 0;
      EXPECT_EQ(posix_spawn(&pid, "/proc/self/exe", nullptr, nullptr, arguments.data(), environ), 0);
      pids_.push_back(pid);
    }
  }
  /// The final words of all, when all ended well.
  std::string join() {
    std::string all;
    for (std::size_t i = 0; i < names.size(); ++i) {
      int status = 0;
      waitpid(pids_[i], &status, 0);
      EXPECT_EQ(status, 0) << names[i];
      std::ifstream in{folder_ / names[i]};
      for (std::string line; std::getline(in, line);) all += names[i] + ": " + line + "\n";
    }
    return all;
  }

 private:
  std::filesystem::path folder_;
  std::vector<pid_t> pids_;
};

std::string run_once(Duration window, double* seconds_a_window = nullptr) {
  const invar::testing::TemporaryFolder folder;
  Node node{testing::local("master"), standard_profiles()};
  SimulatedClockMaster master{node, names, window};
  Processes processes{folder.path()};
  EXPECT_EQ(master.wait_for_all(Duration::milliseconds(30'000)), "");
  const auto begin = std::chrono::steady_clock::now();
  const Advance advance = master.advance_to({10'000'000'000}, Duration::milliseconds(30'000));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(advance.failure, "");
  EXPECT_TRUE(advance.finished);
  EXPECT_EQ(advance.reached.ns, 3'000'000'000);
  if (seconds_a_window != nullptr) *seconds_a_window = took.count() / (3e9 / static_cast<double>(window.ns));
  master.end();
  return processes.join();
}

TEST(SimulatedTime, RepeatsBitForBitOverThreeProcesses) {
  double seconds = 0.0;
  const std::string first = run_once(Duration::milliseconds(10), &seconds);
  std::cout << first << "wall-clock time a window: " << seconds * 1e6 << " us\n";
  EXPECT_THAT(first, ::testing::HasSubstr("one: "));
  EXPECT_THAT(first,
              ::testing::HasSubstr(" 12000 "));  // 300 windows of 30 states and 10 commands
  EXPECT_EQ(run_once(Duration::milliseconds(10)), first);
}

/// Commands itself once a millisecond.
class Commander final : public Component {
 public:
  Output<stage::AxisCommand> command{*this, "command", "command"};
  Inbox<stage::AxisCommand> inbox{*this, "inbox"};
  struct Heard {
    std::uint64_t id;
    std::int64_t at_ns;
  };
  std::vector<Heard> heard;

  void step(const Tick& tick) noexcept override {
    set_now(tick.now);
    for (stage::AxisCommand taken; inbox.take(taken);) heard.push_back({taken.id(), tick.now.ns});
    stage::AxisCommand next;
    next.id(tick.cycle);
    command.write(next);
  }
};

TEST(SimulatedTime, AnInboxHearsItsOwnProcessInTheNextWindow) {
  Node keeper{testing::local("master"), standard_profiles()};
  Node node{testing::local("alone"), standard_profiles()};
  Commander component;
  component.command.topic = component.inbox.topic = "cell/test/alone/inbox";
  SimulatedClockClient client{node};
  client.bind(component.command);
  client.bind(component.inbox);
  const std::atomic<bool> stop{false};
  SimulatedClockClient::Run run;
  std::thread life{[&] {
    std::uint64_t cycle = 0;
    run = client.run(
        [&](Instant until) {
          for (; static_cast<std::int64_t>(cycle) * 1'000'000 < until.ns; ++cycle)
            component.step({{static_cast<std::int64_t>(cycle) * 1'000'000}, 1e-3, cycle});
          return std::string{};
        },
        [] { return false; }, stop, Duration::milliseconds(30'000));
  }};
  SimulatedClockMaster master{keeper, {"alone"}, Duration::milliseconds(10)};
  EXPECT_EQ(master.wait_for_all(Duration::milliseconds(30'000)), "");
  EXPECT_EQ(master.advance_to({50'000'000}, Duration::milliseconds(30'000)).failure, "");
  master.end();
  life.join();
  EXPECT_TRUE(run.ended) << run.failure;
  ASSERT_EQ(component.heard.size(), 40U);  // those of the last window nobody waits for
  for (std::size_t k = 0; k < 40; ++k) {
    EXPECT_EQ(component.heard[k].id, k);
    EXPECT_EQ(component.heard[k].at_ns, static_cast<std::int64_t>(k / 10 + 1) * 10'000'000);
  }
}

TEST(SimulatedTime, AWindowMayHoldMoreThanOneMessage) {
  Node keeper{testing::local("master"), standard_profiles()};
  Node node{testing::local("alone"), standard_profiles()};
  Commander component;
  component.command.topic = "cell/test/alone/command";
  SimulatedClockClient client{node};
  client.bind(component.command);
  std::uint64_t seen = 0, bytes = 0;
  bool in_order = true;
  client.tap([&](const LockstepSample& sample) {
    in_order &= sample.sequence == ++seen;
    bytes += sample.cdr.size();
  });
  const std::atomic<bool> stop{false};
  SimulatedClockClient::Run run;
  std::uint64_t cycle = 0;
  constexpr std::uint64_t a_window = 40'000;
  std::thread life{[&] {
    run = client.run(
        [&](Instant until) {
          for (std::uint64_t k = 0; k < a_window; ++k, ++cycle) component.step({until, 1e-3, cycle});
          return std::string{};
        },
        [] { return false; }, stop, Duration::milliseconds(30'000));
  }};
  SimulatedClockMaster master{keeper, {"alone"}, Duration::milliseconds(10)};
  EXPECT_EQ(master.wait_for_all(Duration::milliseconds(30'000)), "");
  EXPECT_EQ(master.advance_to({30'000'000}, Duration::milliseconds(30'000)).failure, "");
  master.end();
  life.join();
  EXPECT_EQ(run.failure, "");
  EXPECT_EQ(seen, 3 * a_window);
  EXPECT_TRUE(in_order);
  EXPECT_GT(bytes, 3U << 21U) << "the windows fit into two messages each: the test sees too little";
}

TEST(SimulatedTime, SaysWhoIsMissing) {
  Node node{testing::local("master"), standard_profiles()};
  SimulatedClockMaster master{node, {"absent", "gone"}, Duration::milliseconds(10)};
  EXPECT_EQ(master.wait_for_all(Duration::milliseconds(100)),
            "these processes did not join simulated time: absent, gone");
}

TEST(Bundle, CarriesRecordsAndRefusesWhatIsCutOff) {
  Bundle bundle;
  const std::array<std::byte, 3> bytes{std::byte{1}, std::byte{2}, std::byte{3}};
  bundle.add(7, bytes);
  bundle.add(9, {});
  std::vector<std::pair<std::uint32_t, std::size_t>> seen;
  const auto visit = [&](std::uint32_t topic, std::span<const std::byte> cdr) {
    seen.emplace_back(topic, cdr.size());
  };
  EXPECT_TRUE(read_bundle(bundle.bytes(), visit));
  EXPECT_THAT(seen, ::testing::ElementsAre(::testing::Pair(7, 3), ::testing::Pair(9, 0)));
  for (const std::size_t length : {1U, 4U, 8U, 10U, 15U})
    EXPECT_FALSE(read_bundle(std::span{bundle.bytes()}.first(length), visit)) << length;
}

TEST(Membership, ReadsWhatItWrote) {
  const Membership m{"motion", {{"a/b", "x::Y"}, {"c", "z::W"}}, {"d", "*"}};
  const Membership back = read_membership(write_membership(m));
  EXPECT_EQ(back.process, "motion");
  EXPECT_EQ(back.written.size(), 2U);
  EXPECT_EQ(back.written[1].type, "z::W");
  EXPECT_THAT(back.wanted, ::testing::ElementsAre("d", "*"));
}

}  // namespace
}  // namespace invar::dds

int main(int argc, char** argv) {
  if (argc == 6 && std::string{argv[1]} == "--lockstep-process")
    return invar::dds::child(argv[2], static_cast<std::uint32_t>(std::stoul(argv[3])),
                             static_cast<std::uint32_t>(std::stoul(argv[4])), argv[5]);
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
