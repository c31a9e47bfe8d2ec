// Writing and reading recordings: round trips, order, selection, losses, cuts and damage.
#include <gmock/gmock.h>

#include <algorithm>
#include <iostream>
#include <random>
#include <thread>

#include "core/base/fault.hpp"
#include "tests/unit/recording/made_recording.hpp"

namespace invar::recording {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

RecordingOptions small_chunks(Compression compression) {
  RecordingOptions options;
  options.chunks = {compression, 1, 400};
  return options;
}

/// Two channels, `count` messages each, 1 ms apart, sequence numbers from 1.
std::vector<Kept> record_two_topics(const std::filesystem::path& file, const RecordingOptions& options,
                                    std::uint32_t count) {
  RecordingWriter writer{file, options};
  const Bytes cell{'c', 'e', 'l', 'l'};
  writer.attach("cell.yaml", "application/yaml", cell, {1});
  writer.note({"invar.machine", {{"host", "stage-pc"}}});
  const auto a = writer.add_channel(channel_info("cell/a/stage/position"));
  const auto b = writer.add_channel(channel_info("cell/a/heat/temperature"));
  std::vector<Kept> sent;
  for (std::uint32_t i = 1; i <= count; ++i) {
    const Instant time{std::int64_t{i} * 1'000'000};
    for (const auto channel : {a, b}) {
      const Bytes data = payload(channel, i, 24 + i % 7);
      EXPECT_TRUE(writer.write(channel, i, time, time - Duration{500}, data));
      sent.push_back({channel == a ? "cell/a/stage/position" : "cell/a/heat/temperature", i, time, data});
    }
  }
  EXPECT_TRUE(writer.close());
  return sent;
}

class EachCompression : public ::testing::TestWithParam<Compression> {
 protected:
  TemporaryFolder folder;
};
INSTANTIATE_TEST_SUITE_P(Recording, EachCompression,
                         ::testing::Values(Compression::none, Compression::lz4, Compression::zstd),
                         [](const auto& it) {
                           return it.param == Compression::none ? "Plain" : std::string{name_of(it.param)};
                         });

TEST_P(EachCompression, ReadsBackWhatWasWrittenInItsOrder) {
  const auto sent = record_two_topics(folder / "a.mcap", small_chunks(GetParam()), 200);
  const auto recording = Recording::open(folder / "a.mcap");
  EXPECT_TRUE(recording.complete());
  EXPECT_THAT(recording.damage(), IsEmpty());
  EXPECT_EQ(all_messages(recording), sent);
  EXPECT_EQ(recording.statistics().messages, sent.size());
  EXPECT_EQ(recording.statistics().start.ns, 1'000'000);
  EXPECT_EQ(recording.statistics().end.ns, 200'000'000);
  EXPECT_GT(recording.statistics().chunks, 10U);
  ASSERT_THAT(recording.attachments(), SizeIs(1));
  EXPECT_EQ(recording.attachments()[0].name, "cell.yaml");
  EXPECT_THAT(recording.attachments()[0].data, ElementsAre('c', 'e', 'l', 'l'));
  ASSERT_THAT(recording.metadata(), SizeIs(2));
  EXPECT_EQ(recording.metadata()[0].values.at("host"), "stage-pc");
  const auto& channel = recording.channels().at(1);
  EXPECT_EQ(channel.message_encoding, "cdr");
  EXPECT_EQ(channel.metadata.at("partitions"), "line-1");
  EXPECT_EQ(channel.metadata.at("qos"), "reliability: reliable");
  const auto& schema = recording.schemas().at(channel.schema_id);
  EXPECT_EQ(schema.encoding, "omgidl");
  EXPECT_EQ(schema.name, "test::Sample");
  EXPECT_THAT(recording.schemas(), SizeIs(1)) << "both channels have one type";
}

TEST_P(EachCompression, IsReadableUpToACutAtAnyByte) {
  const auto sent = record_two_topics(folder / "a.mcap", small_chunks(GetParam()), 25);
  const std::size_t whole = std::filesystem::file_size(folder / "a.mcap");
  std::size_t readable = sent.size();
  for (std::size_t size = whole - 1; size < whole; --size) {
    std::filesystem::resize_file(folder / "a.mcap", size);
    const auto recording = Recording::open(folder / "a.mcap");
    ASSERT_FALSE(recording.complete()) << size;
    ASSERT_THAT(recording.damage(), SizeIs(1)) << size;
    const auto messages = all_messages(recording);
    ASSERT_LE(messages.size(), sent.size());
    ASSERT_TRUE(std::equal(messages.begin(), messages.end(), sent.begin())) << "cut at byte " << size;
    ASSERT_LE(messages.size(), readable) << "a shorter file has no more messages; cut at byte " << size;
    if (size + 40 > whole) {
      ASSERT_EQ(messages.size(), sent.size()) << "only the footer is cut";
    }
    ASSERT_EQ(recording.statistics().messages, messages.size()) << size;
    readable = messages.size();
  }
  EXPECT_EQ(readable, 0U) << "nothing is left";
}

TEST_P(EachCompression, ReadsTheMessagesBeforeACutInsideOfAChunk) {
  RecordingOptions options;
  options.chunks = {GetParam(), 1, 8U << 20U};  // all in one chunk
  const auto sent = record_two_topics(folder / "a.mcap", options, 20'000);
  const Bytes whole = bytes_of(folder / "a.mcap");
  write_bytes(folder / "cut.mcap", ByteView{whole}.first(whole.size() / 2));
  const auto messages = all_messages(Recording::open(folder / "cut.mcap"));
  EXPECT_GT(messages.size(), sent.size() / 5);
  EXPECT_LT(messages.size(), sent.size());
  EXPECT_TRUE(std::equal(messages.begin(), messages.end(), sent.begin()));
}

TEST_P(EachCompression, LeavesOutADamagedChunkAndSaysSo) {
  const auto sent = record_two_topics(folder / "a.mcap", small_chunks(GetParam()), 100);
  Bytes whole = bytes_of(folder / "a.mcap");
  const auto third = Recording::open(folder / "a.mcap");
  for (const std::size_t from_end :
       {whole.size(), std::size_t{20}}) {  // with its summary, and with that cut away
    Bytes damaged{whole.begin(),
                  whole.begin() + static_cast<std::ptrdiff_t>(from_end == 20 ? whole.size() - 20 : from_end)};
    damaged[damaged.size() / 3] ^= 0x40U;
    write_bytes(folder / "b.mcap", damaged);
    const auto recording = Recording::open(folder / "b.mcap");
    auto stream = recording.messages();
    std::size_t count = 0;
    while (const auto message = stream.next()) {
      EXPECT_THAT(payload(message->channel->id, message->sequence, message->data.size()),
                  ::testing::ElementsAreArray(message->data));
      ++count;
    }
    EXPECT_LT(count, sent.size());
    EXPECT_GT(count + 40, sent.size());
    EXPECT_EQ(stream.damaged_chunks() + recording.damage().size() - (recording.complete() ? 0U : 1U), 1U);
  }
}

TEST_P(EachCompression, SurvivesAnyBytesChanged) {
  const auto seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  std::mt19937_64 random{seed};
  record_two_topics(folder / "a.mcap", small_chunks(GetParam()), 20);
  const Bytes whole = bytes_of(folder / "a.mcap");
  std::fstream file{folder / "a.mcap", std::ios::binary | std::ios::in | std::ios::out};
  std::size_t read = 0;
  for (int round = 0; round < 400; ++round) {
    Bytes damaged = whole;
    const std::size_t from = mcap::magic.size();  // without it, it is no MCAP file at all
    for (auto changes = 1 + random() % 4; changes > 0; --changes)
      damaged[from + random() % (whole.size() - from)] = static_cast<std::uint8_t>(random());
    file.seekp(0).write(reinterpret_cast<const char*>(damaged.data()),
                        static_cast<std::streamsize>(damaged.size()));
    file.flush();
    const auto recording = Recording::open(folder / "a.mcap");
    read += all_messages(recording).size();
    for (const auto& attachment : recording.attachments()) read += attachment.data.size();
    (void)recording.ledger();
  }
  EXPECT_GT(read, 400U) << "most of a damaged file is still there";
}

class RecordingTest : public ::testing::Test {
 protected:
  TemporaryFolder folder;
};

TEST_F(RecordingTest, SelectsByTimeAndTopic) {
  record_two_topics(folder / "a.mcap", small_chunks(Compression::zstd), 200);
  const auto recording = Recording::open(folder / "a.mcap");
  const auto some =
      all_messages(recording, {Instant{50'000'000}, Instant{60'000'000}, {"cell/a/stage/position"}});
  ASSERT_THAT(some, SizeIs(10));
  for (std::size_t i = 0; i < some.size(); ++i) {
    EXPECT_EQ(some[i].sequence, 50 + i);
    EXPECT_EQ(some[i].topic, "cell/a/stage/position");
  }
  EXPECT_THAT(all_messages(recording, {{}, {}, {"no/such/topic"}}), IsEmpty());
}

TEST_F(RecordingTest, GivesMessagesByLogTimeThoughTheyWereWrittenInAnotherOrder) {
  const auto options = small_chunks(Compression::lz4);
  {
    RecordingWriter writer{folder / "a.mcap", options};
    const auto channel = writer.add_channel(channel_info("t"));
    // Times 0..999 shuffled by a step that has no common factor with 1000, so that all chunks overlap.
    for (std::uint32_t i = 0; i < 1000; ++i)
      writer.write(channel, i + 1, Instant{std::int64_t{i * 383U % 1000U} / 2}, {}, payload(1, i, 20));
    EXPECT_TRUE(writer.close());
  }
  const auto messages = all_messages(Recording::open(folder / "a.mcap"));
  ASSERT_THAT(messages, SizeIs(1000));
  for (std::size_t i = 1; i < messages.size(); ++i) {
    ASSERT_LE(messages[i - 1].log_time, messages[i].log_time);
    if (messages[i - 1].log_time == messages[i].log_time) {
      ASSERT_LT(messages[i - 1].sequence, messages[i].sequence) << "equal times keep the order of the file";
    }
  }
}

TEST_F(RecordingTest, AccountsForEverySampleOfManyThreadsThoughTheQueueIsTooSmall) {
  RecordingOptions options;
  options.queue_bytes = 3000;
  constexpr std::uint32_t each = 20'000;
  std::vector<std::uint64_t> accepted(4);
  LossLedger at_close;
  {
    RecordingWriter writer{folder / "a.mcap", options};
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < accepted.size(); ++t)
      threads.emplace_back([&, t] {
        const auto channel = writer.add_channel(channel_info("topic/" + std::to_string(t)));
        for (std::uint32_t i = 1; i <= each; ++i)
          accepted[t] += writer.write(channel, i, Instant{i}, Instant{i}, payload(channel, i, 16)) ? 1U : 0U;
      });
    for (auto& thread : threads) thread.join();
    EXPECT_TRUE(writer.close());
    at_close = writer.ledger();
  }
  const auto recording = Recording::open(folder / "a.mcap");
  const auto ledger = recording.ledger();
  ASSERT_TRUE(ledger);
  EXPECT_GT(ledger->total().lost, 0U) << "the queue holds 50 samples only";
  std::map<std::string, std::uint64_t> read;
  for (const auto& message : all_messages(recording)) ++read[message.topic];
  for (const auto& [id, channel] : ledger->channels) {
    const auto index = static_cast<std::size_t>(channel.topic.back() - '0');
    EXPECT_EQ(channel.arrived, each);
    EXPECT_EQ(channel.written, accepted[index]);
    EXPECT_EQ(channel.written, read[channel.topic]);
    EXPECT_EQ(channel.arrived, channel.written + channel.lost);
    EXPECT_EQ(channel.missing, 0U) << "every sample arrived; a full queue makes no gap in what arrived";
    EXPECT_EQ(channel.lost, at_close.channels.at(id).lost);
  }
}

TEST_F(RecordingTest, FindsGapsAndRestartsInTheSequenceNumbers) {
  RecordingWriter writer{folder / "a.mcap"};
  const auto counted = writer.add_channel(channel_info("counted"));
  const auto uncounted = writer.add_channel(channel_info("uncounted"));
  const auto wrapping = writer.add_channel(channel_info("wrapping"));
  for (const std::uint32_t sequence : {5U, 6U, 9U, 10U, 20U, 1U, 2U})
    writer.write(counted, sequence, {}, {}, payload(1, 1, 4));
  for (int i = 0; i < 3; ++i) writer.write(uncounted, 0, {}, {}, payload(1, 1, 4));
  for (const std::uint32_t sequence : {0xFFFFFFFEU, 0xFFFFFFFFU, 0U, 1U, 2U, 4U})
    writer.write(wrapping, sequence, {}, {}, payload(1, 1, 4));
  EXPECT_TRUE(writer.close());
  const auto ledger = Recording::open(folder / "a.mcap").ledger();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->channels.at(counted).gaps, 2U);
  EXPECT_EQ(ledger->channels.at(counted).missing, 2U + 9U);
  EXPECT_EQ(ledger->channels.at(counted).restarts, 1U);
  EXPECT_EQ(ledger->channels.at(uncounted).gaps, 0U);
  EXPECT_EQ(ledger->channels.at(wrapping).gaps, 1U);
  EXPECT_EQ(ledger->channels.at(wrapping).missing, 1U);
  EXPECT_EQ(ledger->channels.at(wrapping).restarts, 0U);
}

TEST_F(RecordingTest, CountsEverythingAsLostWhenTheDiskIsFull) {
  if (!std::filesystem::exists("/dev/full")) FAIL() << "needs Linux's /dev/full";
  RecordingWriter writer{"/dev/full"};
  const auto channel = writer.add_channel(channel_info("t"));
  for (std::uint32_t i = 1; i <= 100; ++i) writer.write(channel, i, {}, {}, payload(1, i, 50));
  EXPECT_FALSE(writer.close());
  EXPECT_TRUE(writer.status().failed);
  EXPECT_EQ(writer.ledger().channels.at(channel).arrived, 100U);
  EXPECT_EQ(writer.ledger().channels.at(channel).lost, 100U);
}

TEST_F(RecordingTest, IsReadableWhileItIsBeingWritten) {
  RecordingOptions options = small_chunks(Compression::zstd);
  options.chunk_age = Duration::milliseconds(1);
  RecordingWriter writer{folder / "a.mcap", options};
  const auto channel = writer.add_channel(channel_info("t"));
  for (std::uint32_t i = 1; i <= 30; ++i) writer.write(channel, i, Instant{i}, {}, payload(1, i, 50));
  while (writer.ledger().channels.at(channel).written < 30)
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  const auto recording = Recording::open(folder / "a.mcap");
  EXPECT_FALSE(recording.complete());
  EXPECT_THAT(all_messages(recording), SizeIs(30));
}

TEST_F(RecordingTest, RefusesWhatIsNoRecording) {
  write_bytes(folder / "text.mcap", Bytes{'h', 'e', 'l', 'l', 'o'});
  const auto fault_of = [](const std::filesystem::path& file) -> std::string {
    try {
      Recording::open(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(fault_of(folder / "text.mcap"),
              HasSubstr("text.mcap: is no MCAP file; name a recording (.mcap)"));
  EXPECT_THAT(fault_of(folder / "absent.mcap"), HasSubstr("absent.mcap: cannot be read: No such file"));
  EXPECT_THAT(fault_of(folder / "."), HasSubstr("Is a directory"));
  EXPECT_THROW((RecordingWriter{folder / "no" / "such" / "folder.mcap"}), InputError);
}

}  // namespace
}  // namespace invar::recording
