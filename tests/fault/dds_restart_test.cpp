// A process is killed (SIGKILL) and started again, over shared memory: its peers go on. This program is also that process.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/socket.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "core/dds/domain_ports.hpp"
#include "core/dds/node.hpp"
#include "core/dds/shared_memory.hpp"
#include "idl/types.hpp"
#include "tests/interop/process.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/dds/domain.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using testing::local;

int write_for_ever(std::uint32_t domain, std::uint64_t life) {
  NodeOptions options = local("writer");
  options.domain = domain;
  Node node{options, standard_profiles()};
  auto loop = node.writer<stage::AxisState>("cell/test/x", "realtime");
  auto slow = node.writer<thermal::NodeTemperature>("cell/test/heat", "state");
  stage::AxisState sample;
  thermal::NodeTemperature temperature;
  for (;;) {
    sample.at().cycle(life);
    loop.write(sample);
    temperature.at().cycle(life);
    slow.write(temperature);
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
}

TEST(Restart, ReadersGoOnAfterTheirWriterWasKilledAndStartedAgain) {
  Node node{local("reader"), standard_profiles()};
  std::atomic<std::uint64_t> loop_life{0}, slow_life{0};
  const auto loop = node.reader<stage::AxisState>("cell/test/x", "realtime",
                                                  [&](const auto& s) { loop_life = s.at().cycle(); });
  const auto slow = node.reader<thermal::NodeTemperature>("cell/test/heat", "state",
                                                          [&](const auto& t) { slow_life = t.at().cycle(); });
  for (std::uint64_t life = 1; life <= 4; ++life) {
    invar::testing::Child writer{
        {"/proc/self/exe", "--write", std::to_string(testing::test_domain()), std::to_string(life)}};
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_TRUE(eventually([&] { return loop_life == life; })) << "life " << life;
    std::cout << "life " << life << ": loop after "
              << std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    EXPECT_TRUE(eventually([&] { return slow_life == life; })) << "life " << life;
    std::cout << " s, state after "
              << std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() << " s\n";
    kill(writer.pid(), SIGKILL);
    EXPECT_TRUE(eventually([&] { return writer.has_ended(); }));
  }
}

/// Answers the first question. When its answer has arrived it handles one more, which never ends, as with a process that is
/// killed in the midst of it.
int answer_once(std::uint32_t domain, std::uint64_t life) {
  NodeOptions options = local("answering");
  options.domain = domain;
  Node node{options, standard_profiles()};
  auto answer = node.writer<thermal::NodeTemperature>("cell/test/answer", "state");
  std::atomic<bool> asked{false}, answered{false};
  const auto question =
      node.reader<thermal::NodeTemperature>("cell/test/question", "state", [&](const auto&) {
        asked = true;
        while (answered) pause();
      });
  while (!asked || answer.connection().matched() == 0)
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  thermal::NodeTemperature sample;
  sample.at().cycle(life);
  answer.write(sample);
  answered = answer.connection().wait_for_acknowledgments(Duration::milliseconds(20'000));
  for (;;) pause();
}

/// Holds the ports of every number of a participant but one, as other programs would.
class OneNumberLeft {
 public:
  explicit OneNumberLeft(std::uint32_t domain) {
    const DomainPorts ports{domain};
    bool is_left = false;
    for (std::int32_t number = 0; number < ports.participants(); ++number) {
      const int one = hold(ports.discovery(number)), other = hold(ports.data(number));
      const bool leave = !is_left && one >= 0 && other >= 0;
      is_left = is_left || leave;
      for (const int end : {one, other})
        if (end >= 0 && leave)
          close(end);
        else if (end >= 0)
          ends_.push_back(end);
    }
  }
  ~OneNumberLeft() {
    for (const int end : ends_) close(end);
  }
  OneNumberLeft(const OneNumberLeft&) = delete;
  OneNumberLeft& operator=(const OneNumberLeft&) = delete;

 private:
  static int hold(std::uint32_t port) {
    const int end = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    if (bind(end, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return end;
    close(end);
    return -1;
  }
  std::vector<int> ends_;
};

std::uint64_t lives = 10;

TEST(Restart, AProcessThatDiesWhileItHandlesASampleIsHeardAgainWithTheSamePorts) {
  Node node{local("asking"), standard_profiles()};
  std::atomic<std::uint64_t> answered{0};
  auto question = node.writer<thermal::NodeTemperature>("cell/test/question", "state");
  const auto answer = node.reader<thermal::NodeTemperature>(
      "cell/test/answer", "state", [&](const auto& t) { answered = t.at().cycle(); });
  const OneNumberLeft others{testing::test_domain()};
  double slowest = 0.0;
  for (std::uint64_t life = 1; life <= lives; ++life) {
    invar::testing::Child peer{
        {"/proc/self/exe", "--answer", std::to_string(testing::test_domain()), std::to_string(life)}};
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_TRUE(eventually([&] {
      question.write({});
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
      return answered == life;
    })) << "life "
        << life;
    slowest =
        std::max(slowest, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    question.write({});  // in whose midst it dies
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
    kill(peer.pid(), SIGKILL);
    ASSERT_TRUE(eventually([&] { return peer.has_ended(); }));
  }
  std::cout << lives << " lives, the slowest was heard after " << slowest << " s\n";
}

TEST(SharedMemory, OnlyWhatNobodyHoldsAndIsNotYoungIsRemoved) {
  const invar::testing::TemporaryFolder temporary;
  const auto& folder = temporary.path();
  const auto make = [&](const std::string& name) { std::ofstream{folder / name} << "x"; };
  for (const char* name :
       {"fastrtps_dead", "fastrtps_dead_el", "fastrtps_alive", "fastrtps_alive_el", "fastrtps_port7",
        "fastrtps_port7_sl", "sem.fastrtps_port7_mutex", "fastrtps_port9", "other_el"})
    make(name);
  const int held = open((folder / "fastrtps_alive_el").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(flock(held, LOCK_EX), 0);
  EXPECT_EQ(remove_shared_memory_leftovers(folder, Duration::milliseconds(60'000)), 0U);
  EXPECT_EQ(remove_shared_memory_leftovers(folder, {}), 0U)
      << "the port's number must not be taken yet, and somebody may still have to read what lies in the "
         "segment";
  EXPECT_EQ(remove_shared_memory_leftovers(folder, {}), 0U);
  EXPECT_EQ(remove_shared_memory_leftovers(folder, {}, {}), 3U) << "the port without a lock too";
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator{folder})
    left.push_back(entry.path().filename().string());
  EXPECT_THAT(left, ::testing::UnorderedElementsAre("fastrtps_alive", "fastrtps_alive_el", "other_el"));
  close(held);
}

}  // namespace
}  // namespace invar::dds

int main(int argc, char** argv) {
  if (argc == 4 && std::string{argv[1]} == "--write")
    return invar::dds::write_for_ever(static_cast<std::uint32_t>(std::stoul(argv[2])), std::stoull(argv[3]));
  if (argc == 4 && std::string{argv[1]} == "--answer")
    return invar::dds::answer_once(static_cast<std::uint32_t>(std::stoul(argv[2])), std::stoull(argv[3]));
  ::testing::InitGoogleTest(&argc, argv);
  if (argc == 3 && std::string{argv[1]} == "--lives") invar::dds::lives = std::stoull(argv[2]);
  return RUN_ALL_TESTS();
}
