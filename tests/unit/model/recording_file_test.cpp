// The cell's recording as a model reads it: every cycle of stage and world, simulated again, is what was recorded.
#include "core/model/recording_file.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/recording_writer.hpp"
#include "core/recording/type_book.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::model {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

const std::filesystem::path machines = std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / "machines";

constexpr const char* columns =
    "columns: {time: stage_z.state.at, reference: stage_z.state.setpoint_position + correction, position: "
    "stage_z.state.position, current: stage_z.state.current, feedforward: remainder}\n";

/// An axis with friction and ripple in its loop, and every state that it published.
class RecordedAxis : public ::testing::Test {
 protected:
  static world::SimulatedStage::Parameters world_parameters() {
    world::SimulatedStage::Parameters p;
    p.machine = machines / "axis-trials.yaml";
    p.z.model = (machines / "axis-rippled.yaml").string();
    p.z.noise = p.z.resolution = 0.0;
    return p;
  }
  static stage::Stage::Parameters stage_parameters() {
    stage::Stage::Parameters p;
    p.axis = 2;
    p.control.ki = 8e5;
    p.model = machines / "axis-nominal.yaml";
    return p;
  }

  void tell(stage::AxisCommandKind kind, double position = 0.0) {
    axis.tell(kind, position, 0.08);
    for (int k = 0; k < 3000; ++k) {
      axis.wired.step();
      states.push_back(*axis.hand.state.latest());
    }
  }
  void move_about() {
    axis.wired.add(axis.hand);
    axis.wired.add(axis.world);
    axis.wired.add(axis.stage);
    axis.wired.start();
    axis.wired.step();
    axis.wired.step();
    tell(stage::AXIS_COMMAND_ENABLE);
    tell(stage::AXIS_COMMAND_MOVE, 0.08);
    tell(stage::AXIS_COMMAND_MOVE, 0.02);
    tell(stage::AXIS_COMMAND_MOVE, 0.1);
  }

  std::filesystem::path record(const std::function<bool(std::size_t)>& is_kept, std::size_t from = 0) {
    const auto file = folder / "run.mcap";
    const auto& type = *recording::built_in_type("invar::stage::AxisState");
    recording::RecordingWriter writer{file};
    const auto channel = writer.add_channel(
        {"cell/trial/stage_z/state", "invar::stage::AxisState", std::string{type.idl}, "", "", {}});
    auto value = recording::Value::zero(*type.type);
    for (std::size_t i = from; i < states.size(); ++i) {
      const auto& state = states[i];
      value.at("axis")->content = std::uint64_t{state.axis()};
      value.at("at.time_ns")->content = std::int64_t{state.at().time_ns()};
      value.at("at.cycle")->content = std::uint64_t{state.at().cycle()};
      value.at("setpoint_position")->content = state.setpoint_position();
      value.at("correction")->content = state.correction();
      value.at("position")->content = state.position();
      value.at("current")->content = state.current();
      value.at("enabled")->content = state.enabled();
      if (is_kept(i))
        while (!writer.write(channel, static_cast<std::uint32_t>(i + 1), Instant{state.at().time_ns()}, {},
                             encode(value))) {
        }
    }
    EXPECT_TRUE(writer.close());
    return file;
  }
  physics::Model model(const std::string& text_of_columns = columns) {
    std::ifstream in{machines / "axis-rippled.yaml"};
    std::string text{std::istreambuf_iterator<char>{in}, {}};
    const auto begin = text.find("columns:");
    text.replace(begin, text.find('\n', begin) + 1 - begin, text_of_columns);
    std::ofstream{folder / "model.yaml"} << text;
    return model::load(folder / "model.yaml");
  }
  std::string refusal(const std::filesystem::path& file, const physics::Model& of) {
    try {
      (void)read_recording(file, of);
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing is refused";
  }

  testing::TemporaryFolder folder;
  support::WiredAxis axis{world_parameters(), stage_parameters()};
  std::vector<stage::AxisState> states;
};

TEST_F(RecordedAxis, SimulatedWithTheTruthIsWhatWasRecorded) {
  move_about();
  const auto truth = model();
  // From before it was enabled; from within, standing still; with a twentieth of the cycles lost on the way.
  const auto compare = [&](const std::filesystem::path& file, std::size_t rows, bool is_whole,
                           double position, double current) {
    auto tables = read_recording(file, truth);
    ASSERT_EQ(tables.size(), 1U);
    EXPECT_NEAR(static_cast<double>(tables[0].rows()), static_cast<double>(rows), is_whole ? 0.0 : 1.0);
    EXPECT_GT(tables[0].behind, 500U);  // and it says so
    auto record = to_record(tables[0], truth, true).record;
    const auto measured = record.signals;
    for (const char* name : {"position", "current"})
      std::fill(record.signals[name].begin() + 1, record.signals[name].end(), std::nan(""));
    if (is_whole) record.signals.erase("current");
    physics::Outputs simulated;
    physics::prepare(truth, record)->run(truth, simulated);
    double most_position = 0.0, most_current = 0.0;
    for (std::size_t i = 0; i < record.rows(); ++i) {
      most_position = std::max(most_position, std::abs(simulated[0][i] - measured.at("position")[i]));
      most_current = std::max(most_current, std::abs(simulated[1][i] - measured.at("current")[i]));
    }
    EXPECT_LT(most_position, position);
    EXPECT_LT(most_current, current);
  };
  const auto all = [](std::size_t) { return true; };
  std::size_t begin = 0, end = states.size() - 1;
  while (!states[begin].enabled()) ++begin;
  // Half a second behind the last motion: an axis that stands says nothing more.
  while (states[end].setpoint_position() == states[end - 1].setpoint_position()) --end;
  end += 501;
  ASSERT_LT(end + 500, states.size());
  compare(record(all), end - begin, true, 1e-12, 1e-8);
  compare(record(all, 5500), end - 5500, false, 1e-8, 0.02);
  const auto most = [](std::size_t i) { return i % 23 != 7; };
  std::size_t rows = 0;
  for (std::size_t i = begin; i < end; ++i) rows += most(i) ? 1U : 0U;
  compare(record(most), rows, false, 5e-7, 0.05);
}

TEST_F(RecordedAxis, IsCutWhereTheAxisIsNotEnabled) {
  move_about();
  tell(stage::AXIS_COMMAND_DISABLE);
  tell(stage::AXIS_COMMAND_ENABLE);
  tell(stage::AXIS_COMMAND_MOVE, 0.03);
  const auto tables = read_recording(record([](std::size_t) { return true; }), model());
  ASSERT_EQ(tables.size(), 2U);
  EXPECT_GT(tables[0].rows(), 9'500U);
  EXPECT_NEAR(static_cast<double>(tables[1].rows()), 4500.0, 500.0);
  EXPECT_EQ(tables[1].find("stage_z.state.at")->values[0], 0.0);
}

// Its controller's memory is known at rest alone, so a recording that begins within a motion begins where that has ended.
TEST_F(RecordedAxis, BegunWithinAMotionItSaysHowMuchWasLeftOut) {
  move_about();
  std::size_t moving = 0, still = 0;
  while (!states[moving].enabled() || states[moving].setpoint_position() < 0.05) ++moving;
  for (still = moving; states[still].setpoint_position() != states[still + 1].setpoint_position();) ++still;
  const auto tables = read_recording(record([](std::size_t) { return true; }, moving), model());
  ASSERT_EQ(tables.size(), 1U);
  EXPECT_NEAR(static_cast<double>(tables[0].before), static_cast<double>(still - moving), 2.0);
  EXPECT_EQ(tables[0].before + tables[0].rows() + tables[0].behind, states.size() - moving);
}

TEST_F(RecordedAxis, WhatCannotBeUsedIsSaidInOneLine) {
  move_about();
  const auto all = [](std::size_t) { return true; };
  const auto file = record(all);
  const auto named = [](std::string from, std::string to) {
    std::string text = columns;
    const auto at = text.find(from, from == "stage_z.state.position" ? text.find("position: ") : 0);
    text.replace(at, from.size(), to);
    return text;
  };
  EXPECT_THAT(refusal(file, model("columns: {time: t, reference: r, position: y, current: u}\n")),
              HasSubstr("column `t` for `time` is no field of a topic; write component.port.at"));
  EXPECT_THAT(
      refusal(file, model(named("stage_z.state.position", "stage_x.state.position"))),
      HasSubstr("holds no topic `stage_x/state` for `position`; there are: cell/trial/stage_z/state"));
  EXPECT_THAT(
      refusal(file, model(named("state.position", "state.place"))),
      HasSubstr("`cell/trial/stage_z/state` has no field `place` for `position`; it has: cell, axis, at,"));
  EXPECT_THAT(refusal(file, model(named("stage_z.state.position", "'stage_z.state[axis=1].position'"))),
              HasSubstr("holds no sample"));
  EXPECT_EQ(refusal(file, model(named("stage_z.state.position", "'stage_z.state[axis=2].position'"))),
            "nothing is refused");
  EXPECT_THAT(refusal(folder / "none.mcap", model()), HasSubstr("none.mcap: cannot be read"));
  std::ofstream{folder / "empty.mcap"};
  EXPECT_EQ(refusal(folder / "empty.mcap", model()),
            (folder / "empty.mcap").string() + ": is empty; record again");
  ASSERT_EQ(mkfifo((folder / "pipe.mcap").c_str(), 0600), 0);
  EXPECT_THAT(refusal(folder / "pipe.mcap", model()), HasSubstr("pipe.mcap: cannot be read"));
  // Cut off: what is there is read, and where that is too little the cut is what is wrong.
  const auto size = std::filesystem::file_size(file);
  for (const std::uintmax_t keep : {std::uintmax_t{100}, std::uintmax_t{2000}, size / 2, size - 5}) {
    std::filesystem::copy_file(file, folder / "cut.mcap", std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(folder / "cut.mcap", keep);
    const auto said = refusal(folder / "cut.mcap", model());
    if (keep >= size / 2)
      EXPECT_EQ(said, "nothing is refused");
    else
      EXPECT_THAT(said, AllOf(HasSubstr("cut.mcap: the file ends at byte " + std::to_string(keep)),
                              HasSubstr("; copy the file again, or record again")));
  }
  for (const auto& whole : {folder / "cut.mcap", file}) {
    std::filesystem::copy_file(whole, folder / "damaged.mcap",
                               std::filesystem::copy_options::overwrite_existing);
    std::fstream damaged{folder / "damaged.mcap", std::ios::in | std::ios::out | std::ios::binary};
    for (std::uintmax_t at = 20000; at + 5000 < size; at += 5000)
      damaged.seekp(static_cast<std::streamoff>(at)).put('x');
    damaged.close();
    EXPECT_THAT(refusal(folder / "damaged.mcap", model()),
                ContainsRegex("damaged.mcap: .*is damaged.*; copy the file again"));
  }
  EXPECT_THAT(refusal(record([](std::size_t i) { return i % 10 != 0; }), model()),
              ContainsRegex("lacks 1[12][0-9][0-9] of 1[12][0-9][0-9][0-9] cycles of "
                            "`cell/trial/stage_z/state`; record on the PC of the loop"));
  EXPECT_THAT(refusal(record([](std::size_t i) { return i % 20 == 0; }), model()),
              HasSubstr("holds only each 20th cycle of its loop; leave `state` out of `publish`"));
  auto slower = model();
  slower.controller->rate = 500.0;
  EXPECT_THAT(refusal(record(all), slower),
              HasSubstr("was recorded in a loop of 1000 Hz, the model's controller runs at 500 Hz"));
  for (auto& state : states) state.enabled(false);
  EXPECT_THAT(refusal(record(all), model()), HasSubstr("never says that its axis is enabled"));
  states.resize(3);
  EXPECT_THAT(refusal(record(all), model()), HasSubstr("record for longer"));
}

}  // namespace
}  // namespace invar::model
