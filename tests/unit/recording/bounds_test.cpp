// What a few bytes of a recording or a table may make of themselves in memory.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <zlib.h>
#include <zstd.h>

#include <chrono>
#include <functional>

#include "core/base/limits.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/columns.hpp"
#include "core/recording/export.hpp"
#include "core/recording/table.hpp"
#include "tests/unit/recording/made_recording.hpp"

namespace invar::recording {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    EXPECT_EQ(error.faults().size(), 1u);
    return error.what();
  }
  return "taken";
}

/// [MiB] of memory that this process had at most.
long most_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

Bytes zeros_packed(std::size_t size) {
  const Bytes zeros(size);
  Bytes packed(ZSTD_compressBound(size));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), zeros.data(), size, 1));
  return packed;
}

/// A file of chunks that hold `packed`, said to unpack to `size` bytes each.
void write_chunks(const std::filesystem::path& file, const Bytes& packed, std::uint64_t size, int count) {
  Bytes bytes{mcap::magic.begin(), mcap::magic.end()};
  mcap::append(bytes, mcap::Header{"", "test"});
  for (int i = 0; i < count; ++i) {
    Bytes content;
    for (int k = 0; k < 2; ++k) put(content, std::uint64_t{1});
    put(content, size);
    put(content, std::uint32_t{0});
    put_text(content, "zstd");
    put(content, std::uint64_t{packed.size()});
    put(content, ByteView{packed});
    bytes.push_back(static_cast<std::uint8_t>(mcap::Opcode::chunk));
    put(bytes, std::uint64_t{content.size()});
    put(bytes, ByteView{content});
  }
  write_bytes(file, bytes);
}

TEST(Bounds, AChunkThatGrowsToGigabytesIsLeftOut) {
  const TemporaryFolder folder;
  write_chunks(folder / "bomb.mcap", zeros_packed(std::size_t{4} << 20U), std::uint64_t{4} << 30U, 1);
  const long before = most_memory();
  const auto recording = Recording::open(folder / "bomb.mcap");
  EXPECT_THAT(recording.damage(), Contains(HasSubstr("unpacks to 4096 MiB, more than one chunk may")));
  EXPECT_LT(most_memory() - before, 16);
}

TEST(Bounds, ManyChunksTogetherUnpackNoFurtherThanTheirFileAllows) {
  const TemporaryFolder folder;
  const std::uint64_t size = std::uint64_t{200} << 20U;
  write_chunks(folder / "bomb.mcap", zeros_packed(std::size_t{1} << 20U), size, 12);  // they say 2.3 GiB
  const long before = most_memory();
  const auto recording = Recording::open(folder / "bomb.mcap");
  EXPECT_THAT(recording.damage(), Contains(HasSubstr("with those before more than its size allows")));
  EXPECT_LT(most_memory() - before, 600);
}

TEST(Bounds, AThousandDamagedChunksAreTwentySentences) {
  const TemporaryFolder folder;
  write_chunks(folder / "cut.mcap", {1, 2, 3}, 100, 4163);
  const auto recording = Recording::open(folder / "cut.mcap");
  EXPECT_EQ(recording.damage().size(), limits::mcap_damage);
  EXPECT_THAT(recording.damage().back(),
              HasSubstr("(and 4144 more of such faults)"));  // the missing end is one
}

TEST(Bounds, ATopicWhoseNameSteersATerminalIsLeftOutAndTold) {
  const TemporaryFolder folder;
  {
    RecordingWriter writer{folder / "names.mcap"};
    const auto bad = writer.add_channel(channel_info("cell/a\x1b[2Jb/c"));
    const auto good = writer.add_channel(channel_info("cell/`touch x`/\xC2\xB5"));
    writer.write(bad, 1, Instant{1}, Instant{1}, payload(1, 1, 8));
    writer.write(good, 1, Instant{2}, Instant{2}, payload(2, 1, 8));
    writer.close();
  }
  const auto recording = Recording::open(folder / "names.mcap");
  EXPECT_EQ(recording.channels().size(), 1u);
  EXPECT_THAT(recording.damage(),
              Contains(AllOf(HasSubstr("`cell/a\\x1b[2Jb/c`"), HasSubstr("U+001b at byte 7"))));
  EXPECT_EQ(all_messages(recording).size(), 1u);
}

TEST(Bounds, OverlappingChunksAreReadInOrder) {
  const TemporaryFolder folder;
  {
    RecordingOptions options;
    options.chunks.bytes = 64;  // a chunk a message
    RecordingWriter writer{folder / "mixed.mcap", options};
    const auto channel = writer.add_channel(channel_info("a"));
    for (std::uint32_t i = 0; i < 2000; ++i)
      writer.write(channel, i, Instant{static_cast<std::int64_t>((i * 7919U) % 2000U)}, Instant{0},
                   payload(1, i, 64));
    writer.close();
  }
  const auto all = all_messages(Recording::open(folder / "mixed.mcap"));
  ASSERT_EQ(all.size(), 2000u);
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i].log_time.ns, static_cast<std::int64_t>(i));
}

TEST(Bounds, SchemasOfNestedArraysAreRefusedAtTheirLine) {
  const auto fault = [](const std::string& idl) {
    return refusal([&] { (void)parse_idl(idl, "run.mcap: schema S"); });
  };
  EXPECT_THAT(fault("struct S {\n double a[1000][1000][1000]; };"),
              AllOf(HasSubstr("run.mcap: schema S:2: "), HasSubstr("more than 1048576 values")));
  std::string doubling = "struct S0 { long a; };\n";
  for (int i = 1; i < 40; ++i) {
    const std::string before = "S" + std::to_string(i - 1);
    doubling += "struct S" + std::to_string(i) + " { " + before + " a; " + before + " b; };\n";
  }
  EXPECT_THAT(fault(doubling), HasSubstr("more than 1048576 values"));
  std::string deep = "typedef sequence<long> T0;\n";
  for (int i = 1; i < 2000; ++i)
    deep += "typedef sequence<T" + std::to_string(i - 1) + "> T" + std::to_string(i) + ";\n";
  EXPECT_THAT(fault(deep), HasSubstr("nested more than 64 deep"));
  EXPECT_THAT(fault(std::string(2 << 20, ' ')), HasSubstr("bytes of IDL"));
  EXPECT_THAT(fault("struct S { @unit(\"" + std::string(100, 'm') + "\") long a; };"),
              HasSubstr("a unit is too long"));
  EXPECT_EQ(fault("struct S { octet image[1080][1920]; double table[64][64]; sequence<double> a; };"),
            "taken");
}

TEST(Bounds, AMessageOfMillionsOfValuesIsNotTakenApart) {
  const auto schema = parse_idl("struct S { sequence<boolean> a; sequence<octet> b; };", "s");
  const auto with = [&](std::uint32_t booleans, std::uint32_t octets) {
    Bytes bytes{0, 1, 0, 0};
    put(bytes, booleans);
    bytes.resize(bytes.size() + booleans);
    while (bytes.size() % 4 != 0) bytes.push_back(0);
    put(bytes, octets);
    bytes.resize(bytes.size() + octets);
    return decode(*schema.find("S"), bytes);
  };
  EXPECT_TRUE(with(1'000'000, 0).ok());
  EXPECT_TRUE(with(1, 30'000'000).ok());  // a picture
  EXPECT_EQ(with(2'000'000, 0).error(), CdrFault::many);
}

TEST(Bounds, ATableOfATopicHasAsManyColumnsAsASpreadsheet) {
  const auto schema = parse_idl("struct S { double a[64][64][64]; }; struct L { sequence<double> a; };", "s");
  EXPECT_THAT(refusal([&] { Columns{*schema.find("S")}; }), HasSubstr("more than 16384 columns"));
  Columns list{*schema.find("L"), 1'000'000};
  Value value = Value::zero(*schema.find("L"));
  value.at("a")->content =
      std::vector<Value>(100'000, Value::zero(*schema.find("L")->members[0].type->element));
  list.widen(value);
  EXPECT_LE(list.names().size(), limits::table_columns);
  EXPECT_THAT(list.shortened(), ElementsAre("a"));
}

void write_gzip(const std::filesystem::path& file, const std::string& head, const std::string& part,
                std::size_t times) {
  const gzFile out = gzopen(file.c_str(), "wb6");
  gzwrite(out, head.data(), static_cast<unsigned>(head.size()));
  for (std::size_t i = 0; i < times; ++i) gzwrite(out, part.data(), static_cast<unsigned>(part.size()));
  gzclose(out);
}

TEST(Bounds, APackedTableThatGrowsAThousandTimesIsRefusedEarly) {
  const TemporaryFolder folder;
  std::string rows;
  for (int i = 0; i < 10'000; ++i) rows += "1,1,1,1\n";
  write_gzip(folder / "bomb.csv.gz", "a,b,c,d\n", rows, 5000);  // 400 MB of text
  const long before = most_memory();
  EXPECT_THAT(refusal([&] { (void)Table::read(folder / "bomb.csv.gz"); }),
              AllOf(HasSubstr("bomb.csv.gz: unpacks to more than 32 times its size"), HasSubstr("gunzip")));
  EXPECT_LT(most_memory() - before, 400);
}

TEST(Bounds, ALineWithoutEndAndAMillionColumnsAreRefused) {
  const TemporaryFolder folder;
  write_gzip(folder / "line.csv.gz", "", std::string(1 << 20, '7'), 30);
  EXPECT_THAT(refusal([&] { (void)Table::read(folder / "line.csv.gz"); }),
              HasSubstr("line.csv.gz:1: a line has more than 4 MiB"));
  std::string columns = "a0";
  for (int i = 1; i < 300'000; ++i) columns += ",a" + std::to_string(i);
  write_bytes(folder / "wide.csv", Bytes{columns.begin(), columns.end()});
  EXPECT_THAT(refusal([&] { (void)Table::read(folder / "wide.csv"); }),
              HasSubstr("wide.csv:1: has 300000 columns"));
}

TEST(Bounds, ALongRecordingOfManyChannelsIsRead) {
  const TemporaryFolder folder;
  std::string head = "t [s]", rows;
  for (int i = 0; i < 200; ++i) head += ",c" + std::to_string(i) + " [\xC2\xB5m]";
  for (int i = 0; i < 20'000; ++i) {
    rows += std::to_string(i) + "e-3";
    for (int k = 0; k < 200; ++k)
      rows += k < 190 ? ",0" : "," + std::to_string((i * 7919 + k * 104729) % 100000);
    rows += '\n';
  }
  write_gzip(folder / "hour.csv.gz", head + "\n", rows, 1);
  const auto table = Table::read(folder / "hour.csv.gz");
  EXPECT_EQ(table.rows(), 20'000u);
  EXPECT_EQ(table.columns.size(), 201u);
}

TEST(Names, OfColumnsAndLinesHaveNoControlCharacters) {
  const TemporaryFolder folder;
  const auto fault = [&](const std::string& text) {
    write_bytes(folder / "f.csv", Bytes{text.begin(), text.end()});
    return refusal([&] { (void)Table::read(folder / "f.csv", {"line"}); });
  };
  EXPECT_THAT(fault("a\x1b[2J [m],line\n1,x\n"),
              AllOf(HasSubstr("f.csv:1: column `a\\x1b[2J [m]`"), HasSubstr("U+001b at byte 2")));
  EXPECT_THAT(fault("a,line\n1,x\n2,\"y\x07\"\n"),
              AllOf(HasSubstr("f.csv:3: column `line`"), HasSubstr("U+0007 at byte 2")));
  EXPECT_THAT(fault("a\xB5,line\n1,x\n"), HasSubstr("no UTF-8"));
  EXPECT_EQ(fault("`touch x` [\xC2\xB5m],line\n1,$(y)\n"), "taken");
}

TEST(Names, WithCommasAndQuotesComeBackFromATable) {
  const TemporaryFolder folder;
  Table table;
  table.add("a", "m", {1.0, 2.0});
  table.add_texts("line", {"X, left", "Y"});
  table.write(folder / "t.csv");
  const auto again = Table::read(folder / "t.csv", {"line"});
  EXPECT_THAT(again.find("line")->texts, ElementsAre("X, left", "Y"));
}

}  // namespace
}  // namespace invar::recording
