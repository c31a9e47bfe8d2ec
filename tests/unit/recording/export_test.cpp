// Recordings as tables and JSON lines.
#include "core/recording/export.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/fault.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/table.hpp"
#include "tests/unit/recording/made_recording.hpp"

namespace invar::recording {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pointwise;
using ::testing::SizeIs;

constexpr const char* idl = R"(
module test {
  enum Mode { MODE_OFF, MODE_ON };
  @final struct Position {
    @key uint32 axis; @unit("m") double x; Mode mode; int64 time_ns; @unit("V") sequence<double, 4> volts;
    string<20> note; uint32 sequence_number;
  };
  @final struct Clash { double time; };
};)";

class ExportTest : public ::testing::Test {
 protected:
  ExportTest() {
    const auto schema = parse_idl(idl, "t.idl");
    const auto position = schema.find("test::Position");
    const auto clash = schema.find("test::Clash");
    RecordingWriter writer{folder / "a.mcap"};
    const auto a = writer.add_channel({"cell/a/stage/position", "test::Position", idl, "", "", {}});
    const auto again = writer.add_channel({"cell/a/stage/position", "test::Position", idl, "", "", {}});
    const auto b = writer.add_channel({"cell/a/clash", "test::Clash", idl, "", "", {}});
    const auto bad = writer.add_channel({"bad", "test::Absent", idl, "", "", {}});
    for (std::uint32_t i = 0; i < 10; ++i) {
      Value value = Value::zero(*position);
      value.at("axis")->content = std::uint64_t{2};
      value.at("x")->content = 0.1 * i;
      value.at("mode")->content = std::int64_t{i % 2};
      value.at("time_ns")->content = 1'763'763'828'123'456'789 + std::int64_t{i};
      value.at("note")->content = std::string{"a, \"b\""};
      value.at("volts")->content =
          std::vector<Value>(i % 3, Value{position->members[4].type->element.get(), 1.5});
      const Instant time = start + Duration::milliseconds(i);
      writer.write(i % 2 == 0 ? a : again, i + 1, time, time - Duration{5}, encode(value));
      writer.write(b, i + 1, time, time, encode(Value::zero(*clash)));
      writer.write(bad, i + 1, time, time, encode(Value::zero(*clash)));
    }
    writer.write(a, 11, start + Duration::milliseconds(10), start, Bytes{0, 1, 0, 0, 1, 2, 3});
    EXPECT_TRUE(writer.close());
  }

  std::string line(const std::string& file, int number) const {
    std::ifstream in{folder / "out" / file};
    std::string text;
    for (int i = 0; i < number; ++i) std::getline(in, text);
    return text;
  }

  TemporaryFolder folder;
  const Instant start{1'763'763'828'000'000'000};
};

TEST_F(ExportTest, WritesATableATopicThatReadsBackWithItsUnits) {
  const auto report = export_recording(Recording::open(folder / "a.mcap"), folder / "out");
  ASSERT_THAT(report.topics, SizeIs(3));
  EXPECT_EQ(report.topics[0].rows, 10U);
  EXPECT_EQ(report.topics[0].undecodable, 1U);
  EXPECT_EQ(report.topics[0].problem, "message 11: the payload ends before its type does");
  EXPECT_EQ(report.topics[2].problem, "its schema does not define `test::Absent`");
  EXPECT_TRUE(report.topics[2].file.empty());
  EXPECT_EQ(line("cell.a.stage.position.csv", 1),
            "time [s],received [s],log_time [ns],publish_time [ns],sequence,axis,x "
            "[m],mode,time_ns,volts.length,volts[0] [V],"
            "volts[1] [V],note,sequence_number");
  EXPECT_EQ(line("cell.a.stage.position.csv", 3),
            "0.000999995,0.001,1763763828001000000,1763763828000999995,2,2,0.1,MODE_ON,1763763828123456790,1,"
            "1.5,,\"a, "
            "\"\"b\"\"\",0");
  EXPECT_EQ(line("cell.a.clash.csv", 1),
            "recording.time [s],received [s],log_time [ns],publish_time [ns],sequence,time");
  const auto table = Table::read(report.topics[0].file, {"mode", "note"});
  EXPECT_EQ(table.rows(), 10U);
  EXPECT_DOUBLE_EQ(table.in("x", "mm")[3], 300.0);
  EXPECT_EQ(table.find("mode")->texts[1], "MODE_ON");
}

// The laser reads, the recorder hears of it 40 ms later: an evaluation that goes by the recorder's time is 40 ms off.
TEST_F(ExportTest, TheTimeOfASampleIsWhenItWasMade) {
  constexpr const char* stamped = R"(
module test {
  @final struct Stamp { int64 time_ns; uint64 cycle; };
  @final struct Reading { Stamp at; @unit("m") double x; };
};)";
  const auto type = parse_idl(stamped, "s.idl").find("test::Reading");
  {
    RecordingWriter writer{folder / "stamped.mcap"};
    const auto channel = writer.add_channel({"laser", "test::Reading", stamped, "", "", {}});
    const auto simulated = writer.add_channel({"paced", "test::Reading", stamped, "", "", {}});
    const auto write = [&](std::uint16_t to, std::uint32_t number, Instant made) {
      Value value = Value::zero(*type);
      value.at("at.time_ns")->content = made.ns;
      const Instant received = start + Duration::milliseconds(100 * number);
      writer.write(to, number, received, received - Duration::milliseconds(1), encode(value));
    };
    write(channel, 0, start - Duration::milliseconds(40));
    write(channel, 1, start + Duration::milliseconds(60));
    write(channel, 2, Instant{});  // nobody filled it
    write(simulated, 3, Instant{} + Duration::seconds(12.5));
    EXPECT_TRUE(writer.close());
  }
  const auto report = export_recording(Recording::open(folder / "stamped.mcap"), folder / "out");
  const auto laser = Table::read(report.topics.at(0).file);
  const std::vector<double> made{-0.04, 0.06, 0.199}, received{0.0, 0.1, 0.2};
  EXPECT_THAT(laser.in("time", "s"), Pointwise(DoubleNear(1e-12), made));
  EXPECT_THAT(laser.in("received", "s"), Pointwise(DoubleNear(1e-12), received));
  EXPECT_THAT(Table::read(report.topics.at(1).file).in("time", "s"), ElementsAre(12.5));
}

// A first sample is made at 0 and delivered with the window after: its row must not stand before the beginning.
TEST_F(ExportTest, SimulatedTimeIsCountedFromTheStartOfTheCell) {
  constexpr const char* stamped = R"(
module test {
  @final struct Stamp { int64 time_ns; uint64 cycle; };
  @final struct Reading { Stamp at; @unit("m") double x; };
};)";
  const auto type = parse_idl(stamped, "s.idl").find("test::Reading");
  {
    RecordingWriter writer{folder / "simulated.mcap"};
    const auto channel = writer.add_channel({"laser", "test::Reading", stamped, "", "", {}});
    for (std::uint32_t i = 0; i < 3; ++i) {
      Value value = Value::zero(*type);
      value.at("at.time_ns")->content = std::int64_t{i} * 1'000'000;
      const Instant window = Instant{} + Duration::milliseconds(20);
      writer.write(channel, i + 1, window, window, encode(value));
    }
    EXPECT_TRUE(writer.close());
  }
  const auto report = export_recording(Recording::open(folder / "simulated.mcap"), folder / "out");
  const auto rows = Table::read(report.topics.at(0).file).in("time", "s");
  EXPECT_DOUBLE_EQ(rows.at(0), 0.0);
  EXPECT_DOUBLE_EQ(rows.at(1), 0.001);
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
}

TEST_F(ExportTest, TimesOfSendingThatGoBackMakeNoRowsThatDo) {
  const auto type =
      parse_idl("module test { @final struct Bare { double x; }; };", "b.idl").find("test::Bare");
  {
    RecordingWriter writer{folder / "back.mcap"};
    const auto channel = writer.add_channel(
        {"bare", "test::Bare", "module test { @final struct Bare { double x; }; };", "", "", {}});
    for (std::uint32_t i = 0; i < 4; ++i)  // the sender's clock is set back by an hour after two samples
      writer.write(channel, i + 1, start + Duration::seconds(i),
                   start + Duration::seconds(i < 2 ? i : i - 3600.0), encode(Value::zero(*type)));
    EXPECT_TRUE(writer.close());
  }
  const auto report = export_recording(Recording::open(folder / "back.mcap"), folder / "out");
  const auto table = Table::read(report.topics.at(0).file);
  const auto rows = table.in("time", "s");
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
  EXPECT_LT(table.in("publish_time", "ns").at(3), table.in("publish_time", "ns").at(0)) << "kept";
}

TEST_F(ExportTest, WritesOnlyWhatWasSelected) {
  ExportOptions options;
  options.selection = {
      start + Duration::milliseconds(3), start + Duration::milliseconds(6), {"cell/a/stage/position"}};
  const auto report = export_recording(Recording::open(folder / "a.mcap"), folder / "out", options);
  ASSERT_THAT(report.topics, SizeIs(1));
  EXPECT_EQ(report.topics[0].rows, 3U);
  EXPECT_THAT(line("cell.a.stage.position.csv", 2), HasSubstr(",0.003,"));
  options.selection.topics = {"stage.position"};  // component.port
  EXPECT_EQ(export_recording(Recording::open(folder / "a.mcap"), folder / "out", options).topics.at(0).rows,
            3U);
  options.selection.topics = {"cell/a/none"};
  try {
    export_recording(Recording::open(folder / "a.mcap"), folder / "out", options);
    FAIL() << "accepted a topic that is not there";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--topic cell/a/none: is not in the recording"));
  }
}

TEST_F(ExportTest, WritesAJsonObjectAMessage) {
  ExportOptions options;
  options.json = true;
  const auto report = export_recording(Recording::open(folder / "a.mcap"), folder / "out", options);
  EXPECT_EQ(report.topics[0].file.filename(), "cell.a.stage.position.jsonl");
  const auto json = nlohmann::json::parse(line("cell.a.stage.position.jsonl", 3));
  EXPECT_EQ(json["log_time_ns"].get<std::int64_t>(), start.ns + 2'000'000);
  EXPECT_EQ(json["sequence"], 3);
  EXPECT_EQ(json["message"]["mode"], "MODE_OFF");
  EXPECT_EQ(json["message"]["volts"], nlohmann::json({1.5, 1.5}));
  EXPECT_EQ(json["message"]["time_ns"].get<std::int64_t>(), 1'763'763'828'123'456'791);
}

TEST_F(ExportTest, SaysThatTheFolderCannotBeMade) {
  write_bytes(folder / "file", Bytes{'x'});
  EXPECT_THROW(export_recording(Recording::open(folder / "a.mcap"), folder / "file"), InputError);
}

}  // namespace
}  // namespace invar::recording
