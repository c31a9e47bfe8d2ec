// Samples through shared memory: the ring alone, and nodes whose readers and writers find each other by discovery.
#include "core/dds/local_exchange.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <thread>

#include "core/dds/endpoint_id.hpp"
#include "domain.hpp"
#include "idl/types.hpp"
#include "tests/support/real_time_guard.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using testing::local;

/// Unlike any other of this PC: the process is in it.
EndpointId id_of(std::uint32_t number) {
  EndpointId id{};
  const std::array<std::uint32_t, 2> words{static_cast<std::uint32_t>(getpid()), number};
  std::memcpy(id.data(), words.data(), sizeof words);
  return id;
}

bool exists(const std::string& part) {
  for (const auto& entry : std::filesystem::directory_iterator{"/dev/shm"})
    if (entry.path().filename().string().find(part) != std::string::npos) return true;
  return false;
}

void write(SampleRing& ring, std::uint64_t value, std::size_t words = 8) {
  const auto room = ring.begin();
  for (std::size_t i = 0; i < words; ++i) std::memcpy(room.data() + 8 * i, &value, 8);
  ring.commit(8 * words);
}

std::vector<std::uint64_t> read_all(SampleRing& ring, std::uint64_t& lost) {
  std::vector<std::uint64_t> values;
  lost += ring.read([&](std::span<const std::byte> bytes) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data(), 8);
    values.push_back(value);
  });
  return values;
}

TEST(SampleRing, AReaderGetsEverySampleSinceItAttachedInOrder) {
  const auto writer = SampleRing::make(id_of(1), 64);
  ASSERT_TRUE(writer);
  write(*writer, 1);
  const auto reader = SampleRing::open(id_of(1));
  ASSERT_TRUE(reader);
  EXPECT_FALSE(writer->has_readers());
  ASSERT_TRUE(reader->attach(id_of(2)));
  EXPECT_TRUE(writer->has_readers());
  EXPECT_TRUE(writer->is_attached(id_of(2)));
  EXPECT_FALSE(writer->is_attached(id_of(3)));
  std::uint64_t lost = 0;
  EXPECT_THAT(read_all(*reader, lost), ::testing::IsEmpty());
  for (std::uint64_t value = 2; value < 10; ++value) write(*writer, value);
  EXPECT_THAT(read_all(*reader, lost), ::testing::ElementsAre(2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_EQ(lost, 0U);
  writer->detach(id_of(2));
  EXPECT_FALSE(writer->has_readers());
}

TEST(SampleRing, AReaderThatIsLateLosesTheOldestAndCountsThem) {
  const auto writer = SampleRing::make(id_of(1), 64);
  const auto reader = SampleRing::open(id_of(1));
  ASSERT_TRUE(reader && reader->attach(id_of(2)));
  for (std::uint64_t value = 0; value < SampleRing::depth + 5; ++value) write(*writer, value);
  std::uint64_t lost = 0;
  const auto values = read_all(*reader, lost);
  EXPECT_EQ(lost, 5U);
  EXPECT_EQ(values.size(), SampleRing::depth);
  EXPECT_EQ(values.front(), 5U);
}

TEST(SampleRing, NoSampleArrivesTornWhileTheWriterOvertakesTheReader) {
  constexpr std::size_t words = 512;
  const auto writer = SampleRing::make(id_of(1), 8 * words);
  const auto reader = SampleRing::open(id_of(1));
  ASSERT_TRUE(reader && reader->attach(id_of(2)));
  std::atomic<bool> stop{false};
  std::thread writing{[&] {
    for (std::uint64_t value = 1; !stop; ++value) write(*writer, value, words);
  }};
  std::uint64_t whole = 0, lost = 0, last = 0;
  bool ascending = true, equal = true;
  while (whole < 20'000)
    lost += reader->read([&](std::span<const std::byte> bytes) {
      std::array<std::uint64_t, words> values;
      std::memcpy(values.data(), bytes.data(), sizeof values);
      equal = equal && std::all_of(values.begin(), values.end(), [&](auto v) { return v == values[0]; });
      ascending = ascending && values[0] > last;
      last = values[0];
      ++whole;
    });
  stop = true;
  writing.join();
  EXPECT_TRUE(equal);
  EXPECT_TRUE(ascending);
  EXPECT_EQ(whole + lost, last) << "each sample either arrived or was counted as lost";
}

TEST(SampleRing, ManyReadersAttachAndTheNextIsRefused) {
  const auto writer = SampleRing::make(id_of(1), 64);
  for (std::uint32_t i = 0; i < SampleRing::most_readers; ++i)
    EXPECT_TRUE(SampleRing::open(id_of(1))->attach(id_of(10 + i)));
  EXPECT_FALSE(SampleRing::open(id_of(1))->attach(id_of(100)));
  writer->detach(id_of(11));
  EXPECT_TRUE(SampleRing::open(id_of(1))->attach(id_of(100)));
}

TEST(SampleRing, AFileOfAnotherLayoutIsNotOpened) {
  const auto file = SharedFile::make("ring_" + std::string(32, '0'), 4096);
  ASSERT_TRUE(file);
  EXPECT_EQ(SampleRing::open(EndpointId{}), nullptr);
}

TEST(SharedFile, ALeftoverOfAKilledProcessIsRemovedAndALivingOneStays) {
  const std::string name = "leftover_" + std::to_string(getpid());
  const pid_t child = fork();
  if (child == 0) {
    const auto file = SharedFile::make(name, 4096);
    _exit(file ? 0 : 1);  // as if killed: nothing is removed
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_EQ(status, 0);
  ASSERT_TRUE(exists(name));
  const auto living = SharedFile::make(name + "_living", 4096);
  ASSERT_TRUE(eventually([&] {
    (void)remove_abandoned_shared_files();
    return SharedFile::open(name) == nullptr;
  }));
  EXPECT_NE(SharedFile::open(name + "_living"), nullptr);
}

TEST(Bell, WakesASleeperAndCostsNothingWhileNobodySleeps) {
  Bell bell;
  std::atomic<bool> woken{false};
  std::thread sleeper{[&] {
    while (bell.rung == 0) sleep_on(bell, 0, Duration::seconds(20.0));
    woken = true;
  }};
  ASSERT_TRUE(eventually([&] { return bell.sleeping != 0; }));
  ring(bell);
  sleeper.join();
  EXPECT_TRUE(woken);
  EXPECT_EQ(bell.sleeping, 0U);
  const support::RealTimeGuard guard;
  for (int i = 0; i < 1000; ++i) ring(bell);
  EXPECT_EQ(guard.violations(), 0U);
}

struct Source final : Component {
  Output<stage::AxisState> state{*this, "state"};
  void step(const Tick&) noexcept override {}
};

/// A writing node with a paced output, as a loop has it.
class Exchange : public ::testing::Test {
 protected:
  Exchange() { source.state.topic = topic_name("test", "axis", "state"); }
  void begin() {
    writing.bind(source.state, {Duration::milliseconds(1), {}});
    writing.start();
  }
  void cycle() {
    stage::AxisState state;
    state.at().cycle(++cycles);
    source.set_now(utc_now());
    source.state.write(state);
    writing.cycle_ended();
  }
  Source source;
  Node writing{local("writing"), standard_profiles()};
  std::uint64_t cycles = 0;
};

struct Received {
  std::mutex mutex;
  std::vector<std::uint64_t> cycles;
  std::function<void(const stage::AxisState&)> take = [this](const stage::AxisState& state) {
    const std::lock_guard lock{mutex};
    cycles.push_back(state.at().cycle());
  };
  std::size_t count() {
    const std::lock_guard lock{mutex};
    return cycles.size();
  }
};

TEST_F(Exchange, EachSampleArrivesOnceThroughMemoryAlsoBesideAReaderOfTheTopicAlone) {
  begin();
  Node reading{local("reading"), standard_profiles()};
  Received near, far;
  const auto reader = reading.reader<stage::AxisState>(source.state.topic, "realtime", near.take);
  ASSERT_TRUE(eventually([&] { return cycle(), near.count() > 0; }));
  // A reader without shared memory comes later: it gets the samples by the topic, and the first one none of them twice.
  NodeOptions udp = local("udp");
  udp.shared_memory = false;
  Node apart{udp, standard_profiles()};
  const auto other = apart.reader<stage::AxisState>(source.state.topic, "realtime", far.take);
  ASSERT_TRUE(eventually([&] { return cycle(), far.count() > 50; }));
  const std::lock_guard lock{near.mutex};
  EXPECT_TRUE(std::is_sorted(near.cycles.begin(), near.cycles.end(), std::less_equal<>{}))
      << "ascending, none twice";
}

TEST_F(Exchange, TheMiddlewareIsLeftAloneWhileEveryReaderSharesMemory) {
  begin();
  Node reading{local("reading"), standard_profiles()};
  Received near;
  const auto reader = reading.reader<stage::AxisState>(source.state.topic, "realtime", near.take);
  ASSERT_TRUE(eventually([&] { return cycle(), near.count() > 100; }));
  // The raw reader sees what the topic itself carries; it makes the writer use the topic again.
  std::atomic<std::uint64_t> first{0}, raw{0};
  const auto before = cycles;
  const auto on_topic = reading.raw_reader(source.state.topic, "invar::stage::AxisState",
                                           reading.profile("realtime"), [&](const RawSample& sample) {
                                             if (first == 0) first = sample.sequence;
                                             ++raw;
                                           });
  ASSERT_TRUE(eventually([&] { return cycle(), raw > 20; }));
  EXPECT_GT(near.count(), raw.load());
  EXPECT_LT(first.load(), before / 2)
      << "the writer counted fewer samples on the topic than the loop had cycles";
}

TEST_F(Exchange, AReaderThatEndsAndANewOneAreServed) {
  begin();
  for (int round = 0; round < 3; ++round) {
    Node reading{local("reading" + std::to_string(round)), standard_profiles()};
    Received near;
    const auto reader = reading.reader<stage::AxisState>(source.state.topic, "realtime", near.take);
    ASSERT_TRUE(eventually([&] { return cycle(), near.count() > 20; })) << round;
  }
}

TEST_F(Exchange, TheLoopNeitherAllocatesNorLocksWhenItWrites) {
  begin();
  Node reading{local("reading"), standard_profiles()};
  Received near;
  const auto reader = reading.reader<stage::AxisState>(source.state.topic, "realtime", near.take);
  ASSERT_TRUE(eventually([&] { return cycle(), near.count() > 100; }));
  const support::RealTimeGuard guard;
  for (int i = 0; i < 1000; ++i) cycle();
  EXPECT_EQ(guard.violations(), 0U);
}

}  // namespace
}  // namespace invar::dds
