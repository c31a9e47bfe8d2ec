// A writing process is killed (SIGKILL) and started again, over shared memory: readers go on. This program is also the
// writing process.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>

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
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
