// The recorder and the black box on a disk that takes no more: the kernel refuses to let files of this process grow.
#include "components/recorder/recorder.hpp"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <random>
#include <thread>

#include "core/base/fault.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tools/cell/black_box_file.hpp"

namespace invar::recorder {
namespace {

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
