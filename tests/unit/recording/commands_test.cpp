// `invar export` and `invar recording` as a user types them.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/recording/cdr.hpp"
#include "core/recording/type_book.hpp"
#include "tests/unit/recording/made_recording.hpp"

namespace invar::recording {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int status = 0;
  std::string text;  // both streams
};

Outcome invar(const std::string& arguments) {
  FILE* pipe = popen((std::string{INVAR_PROGRAM} + " " + arguments + " 2>&1").c_str(), "r");
  Outcome run;
  std::array<char, 4096> block{};
  for (std::size_t got = 0; (got = fread(block.data(), 1, block.size(), pipe)) > 0;)
    run.text.append(block.data(), got);
  const int status = pclose(pipe);
  run.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return run;
}

class RecordingCommands : public ::testing::Test {
 protected:
  RecordingCommands() {
    const BuiltInType& type = *built_in_type("invar::stage::AxisState");
    RecordingWriter writer{file};
    writer.attach("cell.yaml", "application/yaml", Bytes{'x'}, {});
    const auto channel = writer.add_channel(
        {"cell/a/stage/state", "invar::stage::AxisState", std::string{type.idl}, "", "", {}});
    Value value = Value::zero(*type.type);
    for (std::uint32_t i = 1; i <= 100; ++i) {
      value.at("position")->content = 1e-6 * i;
      if (i != 50) writer.write(channel, i, Instant{1'000'000LL * i}, {}, encode(value));
    }
    EXPECT_TRUE(writer.close());
  }

  TemporaryFolder folder;
  std::filesystem::path file = folder / "a.mcap";
};

TEST_F(RecordingCommands, InfoShowsChannelsCountsAndLosses) {
  const Outcome run = invar("recording info " + file.string());
  EXPECT_EQ(run.status, 0);
  EXPECT_THAT(run.text, HasSubstr("99 messages in 0.099 s"));
  EXPECT_THAT(run.text, HasSubstr("cell/a/stage/state"));
  EXPECT_THAT(run.text, HasSubstr("invar::stage::AxisState"));
  EXPECT_THAT(run.text, HasSubstr("attachment  cell.yaml (1 bytes)"));
  const auto json = nlohmann::json::parse(invar("recording info --json " + file.string()).text);
  EXPECT_EQ(json["messages"], 99);
  EXPECT_EQ(json["channels"][0]["ledger"]["missing"], 1);
  EXPECT_EQ(json["complete"], true);
}

TEST_F(RecordingCommands, RecoverMakesACutFileWhole) {
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 10);
  EXPECT_THAT(invar("recording info " + file.string()).text, HasSubstr("not closed"));
  const Outcome run = invar("recording recover " + file.string());
  EXPECT_EQ(run.status, 0);
  EXPECT_THAT(
      run.text,
      HasSubstr("a.recovered.mcap: 99 messages of 1 channels; by their sequence numbers 1 are missing"));
  EXPECT_TRUE(Recording::open(folder / "a.recovered.mcap").complete());
  const auto json = nlohmann::json::parse(
      invar("recording recover --json " + file.string() + " --out " + (folder / "b.mcap").string()).text);
  EXPECT_EQ(json["messages"], 99);
  EXPECT_EQ(json["missing"], 1);
  EXPECT_EQ(json["recovered"], (folder / "b.mcap").string());
  EXPECT_FALSE(json["damage"].empty());
}

TEST_F(RecordingCommands, ExportWritesUnitsIntoTheHeader) {
  const Outcome run =
      invar("export " + file.string() + " --out " + (folder / "out").string() + " --from 0.01 --to 0.02");
  EXPECT_EQ(run.status, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("cell.a.stage.state.csv: 10 rows"));
  std::ifstream table{folder / "out" / "cell.a.stage.state.csv"};
  std::string header, row;
  std::getline(table, header);
  std::getline(table, row);
  EXPECT_THAT(header, HasSubstr(",setpoint_velocity [m/s],"));
  EXPECT_THAT(row, HasSubstr(",AXIS_MODE_DISABLED,"));
}

TEST_F(RecordingCommands, FaultsAreOneLineAndStatusTwo) {
  const auto expect_fault = [&](const std::string& arguments, const std::string& words) {
    const Outcome run = invar(arguments);
    EXPECT_EQ(run.status, 2) << run.text;
    EXPECT_THAT(run.text, HasSubstr(words));
    EXPECT_EQ(std::count(run.text.begin(), run.text.end(), '\n'), 1) << run.text;
  };
  expect_fault("recording info " + (folder / "none.mcap").string(),
               "none.mcap: cannot be read: No such file");
  expect_fault("export " + file.string(), "--out is required");
  expect_fault("export " + file.string() + " --topic none --out " + (folder / "o").string(),
               "--topic none: is not in the recording; `invar recording info` lists its topics");
  expect_fault("export " + file.string() + " --from soon --out " + (folder / "o").string(), "--from");
}

TEST_F(RecordingCommands, ARealTimeRecordingIsNotRunAgainInSimulatedTime) {
  const auto real = folder / "real.mcap";
  {
    RecordingWriter writer{real};
    writer.attach("cell.yaml", "application/yaml", Bytes{'x'}, {});
    const auto channel = writer.add_channel(channel_info("t"));
    writer.write(channel, 1, Instant{1'790'000'000'000'000'000}, {}, payload(1, 1, 8));
    EXPECT_TRUE(writer.close());
  }
  const Outcome run =
      invar("replay " INVAR_SOURCE_DIR "/deployment/xy-table.yaml " + real.string() + " --into motion");
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.text, HasSubstr("real.mcap: was recorded in real time"));
}

}  // namespace
}  // namespace invar::recording
