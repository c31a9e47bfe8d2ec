// Replaying at any speed, and recovering cut files.
#include "core/recording/replayer.hpp"

#include <gmock/gmock.h>

#include "core/base/fault.hpp"
#include "core/recording/recover.hpp"
#include "tests/unit/recording/made_recording.hpp"

namespace invar::recording {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ReplayTest : public ::testing::Test {
 protected:
  /// Messages 10, 20, 30, ... ms after a start; sequence numbers from 1, but `missing` is left out.
  void record(std::uint32_t count, std::uint32_t missing = 0) const {
    RecordingOptions options;
    options.chunks.bytes = 500;
    RecordingWriter writer{file, options};
    writer.attach("cell.yaml", "application/yaml", Bytes{'x'}, {});
    writer.note({"invar.machine", {{"host", "stage-pc"}}});
    const auto channel = writer.add_channel(channel_info("t"));
    for (std::uint32_t i = 1; i <= count; ++i)
      if (i != missing)
        writer.write(channel, i, start + Duration::milliseconds(10) * i, {}, payload(1, i, 50));
    ASSERT_TRUE(writer.close());
  }
  static std::vector<std::uint32_t> due_by(Replayer& replayer, Instant now) {
    std::vector<std::uint32_t> sequences;
    while (const auto message = replayer.next(now)) {
      sequences.push_back(message->sequence);
      EXPECT_THAT(message->data, ::testing::ElementsAreArray(payload(1, message->sequence, 50)));
    }
    return sequences;
  }

  TemporaryFolder folder;
  std::filesystem::path file = folder / "a.mcap";
  const Instant start{1'700'000'000'000'000'000};
  const Instant now{5'000'000'000};
};

TEST_F(ReplayTest, GivesEachMessageAtItsTime) {
  record(5);
  Replayer replayer{Recording::open(file).messages(), now};
  EXPECT_EQ(replayer.due(), now);
  EXPECT_THAT(due_by(replayer, now - Duration{1}), IsEmpty());
  EXPECT_THAT(due_by(replayer, now), ElementsAre(1));
  EXPECT_EQ(replayer.due(), now + Duration::milliseconds(10));
  EXPECT_THAT(due_by(replayer, now + Duration::milliseconds(25)), ElementsAre(2, 3));
  EXPECT_THAT(due_by(replayer, now + Duration::milliseconds(1000)), ElementsAre(4, 5));
  EXPECT_EQ(replayer.due(), std::nullopt);
}

TEST_F(ReplayTest, KeepsItsPlaceWhenTheSpeedChanges) {
  record(100);
  Replayer replayer{Recording::open(file).messages(), now, 2.0};
  EXPECT_THAT(due_by(replayer, now + Duration::milliseconds(10)), ElementsAre(1, 2, 3));
  EXPECT_EQ(replayer.log_time_at(now + Duration::milliseconds(10)), start + Duration::milliseconds(30));
  replayer.set_speed(0.5, now + Duration::milliseconds(10));
  EXPECT_EQ(replayer.due(), now + Duration::milliseconds(30));
  EXPECT_THAT(due_by(replayer, now + Duration::milliseconds(50)), ElementsAre(4, 5));
  replayer.set_speed(Replayer::as_fast_as_possible, now + Duration::milliseconds(50));
  EXPECT_THAT(due_by(replayer, now + Duration::milliseconds(50)), SizeIs(95));
}

TEST_F(ReplayTest, RecoveryMakesAWholeFileOfACutOne) {
  record(300, 7);
  const auto before = all_messages(Recording::open(file));
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const auto readable = all_messages(Recording::open(file));
  const auto result = recover(Recording::open(file), folder / "b.mcap");
  const auto recovered = Recording::open(folder / "b.mcap");
  EXPECT_TRUE(recovered.complete());
  EXPECT_THAT(recovered.damage(), IsEmpty());
  EXPECT_EQ(all_messages(recovered), readable);
  EXPECT_GT(readable.size(), before.size() / 4);
  EXPECT_EQ(result.messages, readable.size());
  ASSERT_THAT(recovered.attachments(), SizeIs(1));
  EXPECT_EQ(recovered.attachments()[0].name, "cell.yaml");
  EXPECT_EQ(recovered.metadata()[0].values.at("host"), "stage-pc");
  const auto ledger = recovered.ledger();
  ASSERT_TRUE(ledger);
  EXPECT_TRUE(ledger->recovered);
  EXPECT_EQ(ledger->channels.at(1).written, readable.size());
  EXPECT_EQ(ledger->channels.at(1).gaps, 1U);
  EXPECT_EQ(ledger->channels.at(1).missing, 1U);
}

TEST_F(ReplayTest, RecoverySaysWhereItCannotWrite) {
  record(3);
  EXPECT_THROW(recover(Recording::open(file), folder / "none" / "b.mcap"), InputError);
}

}  // namespace
}  // namespace invar::recording
