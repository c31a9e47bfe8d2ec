// The recorder and the black box on a disk that takes no more: the kernel refuses to let files of this process grow.
#include "components/recorder/recorder.hpp"

#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <random>
#include <thread>

#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/recording/recording_reader.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tools/cell/black_box_file.hpp"

namespace invar::recorder {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct FullDisk {
  explicit FullDisk(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before);
    const rlimit limit{bytes, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() { setrlimit(RLIMIT_FSIZE, &before); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  rlimit before{};
};

TEST(Recorder, ADiskThatTakesNoMoreIsAnErrorOfTheComponent) {
  const invar::testing::TemporaryFolder folder;
  const Recorder::Parameters parameters{.out = folder.path().string(), .topics = {}};
  Recorder recorder{parameters};
  recorder.configure();
  recorder.activate();
  std::mt19937_64 random{7};
  std::vector<std::byte> noise(4096);
  const auto feed = [&](bool until_error) {
    for (std::uint64_t i = 1; i < 3000 && (recorder.failure() == nullptr || !until_error); ++i) {
      for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
      recorder.record({"a", "t", "state", ""}, "writer", i, Instant{static_cast<std::int64_t>(i)},
                      Instant{static_cast<std::int64_t>(i)}, noise);
      recorder.step({Instant{static_cast<std::int64_t>(i) * 20'000'000}, 0.02, i});
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
      if (!until_error && i == 100) return;
    }
  };
  feed(false);
  EXPECT_EQ(recorder.failure(), nullptr);
  {
    const FullDisk full{200'000};
    feed(true);
  }
  ASSERT_NE(recorder.failure(), nullptr);
  EXPECT_THAT(recorder.failure(), HasSubstr("the disk takes no more"));
  // Room again: a new recording, the old one kept.
  recorder.cleanup();
  recorder.clear_failure();
  recorder.configure();
  recorder.activate();
  feed(false);
  EXPECT_EQ(recorder.failure(), nullptr);
  recorder.cleanup();
  EXPECT_TRUE(std::filesystem::exists(folder / "recording-1.mcap"));
}

/// Noise that no compression makes smaller, until the component is in error or so many samples have gone by.
void feed_noise(Recorder& recorder, std::size_t samples) {
  std::mt19937_64 random{7};
  std::vector<std::byte> noise(100'000);
  for (std::uint64_t i = 1; i <= samples && recorder.failure() == nullptr; ++i) {
    for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
    const Instant at{static_cast<std::int64_t>(i)};
    recorder.record({"a", "t", "state", ""}, "writer", i, at, at, noise);
    recorder.step({Instant{static_cast<std::int64_t>(i) * 20'000'000}, 0.02, i});
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
}

TEST(Recorder, SamplesThatCameBeforeItsFileWasOpenAreRecordedAndLaterOnesOfAClosedOneAreNot) {
  const invar::testing::TemporaryFolder folder;
  const Recorder::Parameters parameters{.out = folder.path().string(), .topics = {}};
  Recorder recorder{parameters};
  const std::vector<std::byte> bytes(8);
  const auto take = [&](std::uint64_t number) {
    const Instant at{static_cast<std::int64_t>(number)};
    recorder.record({"a", "t", "state", ""}, "writer", number, at, at, bytes);
  };
  const auto recorded = [&] {
    std::vector<std::uint32_t> numbers;
    const auto recording = recording::Recording::open(recorder.file());
    for (auto messages = recording.messages(); const auto message = messages.next();)
      numbers.push_back(message->sequence);
    return numbers;
  };
  take(1);
  take(2);
  recorder.configure();
  take(3);
  recorder.cleanup();
  EXPECT_THAT(recorded(), ElementsAre(1, 2, 3));
  take(4);
  recorder.configure();
  take(5);
  recorder.cleanup();
  EXPECT_THAT(recorded(), ElementsAre(5));
}

TEST(Recorder, EndsWholeAtTheReserveThatIsLeftForBlackBoxes) {
  const invar::testing::TemporaryFolder folder;
  // The disk of the test is whatever it is: the reserve is what it has but for 8 MB.
  const auto free_mb = static_cast<std::int64_t>(std::filesystem::space(folder.path()).available / 1'000'000);
  const Recorder::Parameters parameters{
      .out = folder.path().string(), .topics = {}, .reserve_mb = std::max<std::int64_t>(free_mb - 8, 1)};
  Recorder recorder{parameters};
  recorder.configure();
  recorder.activate();
  feed_noise(recorder, 5000);  // half a gigabyte, were it not for the reserve
  ASSERT_NE(recorder.failure(), nullptr);
  EXPECT_THAT(recorder.failure(), HasSubstr("has its reserve for black boxes left"));
  const auto recording = recording::Recording::open(recorder.file());
  EXPECT_TRUE(recording.complete());
  EXPECT_LT(std::filesystem::file_size(recorder.file()), 200'000'000U);
  BlackBoxRecord record;
  record.process = "motion";
  record.cycles.resize(100);
  EXPECT_TRUE(std::filesystem::exists(tools::write_black_box(record, folder.path())));
  recorder.cleanup();
}

TEST(Recorder, WithoutAReserveTheDiskIsTheirs) {
  const invar::testing::TemporaryFolder folder;
  const Recorder::Parameters parameters{.out = folder.path().string(), .topics = {}, .reserve_mb = 0};
  Recorder recorder{parameters};
  recorder.configure();
  recorder.activate();
  feed_noise(recorder, 30);
  EXPECT_EQ(recorder.failure(), nullptr);
  recorder.cleanup();
}

TEST(Recorder, FilesAreReadByTheGroupAndNobodyElseUnderALaxUmask) {
  const invar::testing::TemporaryFolder folder;
  const mode_t before = umask(0);
  const Recorder::Parameters parameters{.out = folder.path().string(), .topics = {}};
  Recorder recorder{parameters};
  recorder.configure();
  recorder.cleanup();
  BlackBoxRecord record;
  record.process = "motion";
  record.cycles.resize(100);
  const auto box = tools::write_black_box(record, folder.path());
  write_file(folder / "report.html", "text");
  new_stream(folder / "model.yaml") << "text";
  umask(before);
  for (const auto& file : {recorder.file(), box, folder / "report.html", folder / "model.yaml"})
    EXPECT_EQ(static_cast<unsigned>(std::filesystem::status(file).permissions()), 0640U) << file;
}

TEST(BlackBoxFile, IsWrittenWholeOrNotAtAll) {
  const invar::testing::TemporaryFolder folder;
  BlackBoxRecord record;
  record.process = "motion";
  record.reason = "test";
  std::mt19937_64 random{7};
  std::uniform_real_distribution<double> any;
  record.signals = {{"a.position", "m"}};
  record.cycles.resize(5000);
  for (std::size_t i = 0; i < record.cycles.size(); ++i) record.samples.push_back(any(random));
  {
    const FullDisk full{20'000};
    EXPECT_THROW((void)tools::write_black_box(record, folder.path()), InputError);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  EXPECT_TRUE(std::filesystem::exists(tools::write_black_box(record, folder.path())));
}

}  // namespace
}  // namespace invar::recorder
