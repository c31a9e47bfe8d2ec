// What is not for an input - another cell, axis or node, a number that is none - from real writers of DDS.
#include <gmock/gmock.h>
#include <malloc.h>

#include <cmath>
#include <iostream>
#include <limits>
#include <random>

#include "core/dds/clock_offset.hpp"
#include "core/dds/command_gate.hpp"
#include "core/dds/node.hpp"
#include "domain.hpp"
#include "idl/types.hpp"

namespace invar::dds {
namespace {

using ::testing::AllOf;
using testing::eventually;
using ::testing::HasSubstr;
using testing::local;

/// A servo of cell 1, axis 0, and what it heard.
struct Servo final : Component {
  Inbox<stage::AxisCommand> command{*this, "command", {.profile = "command"}, 16384};
  Input<stage::AxisFeedback> feedback{*this, "feedback"};
  Input<thermal::NodeTemperature> temperature{*this, "temperature", {.profile = "state"}};
  Servo() {
    cell = 1;
    command.key = feedback.key = 0;
    temperature.keys = {7};
    command.topic = "cell/test/servo/command";
    feedback.topic = "cell/test/world/feedback";
    temperature.topic = "cell/test/thermal/temperature";
  }
  void step(const Tick&) noexcept override {}
  /// Ids of the commands since the last call.
  std::vector<std::uint64_t> take() {
    std::vector<std::uint64_t> ids;
    for (stage::AxisCommand taken; command.take(taken);) ids.push_back(taken.id());
    return ids;
  }
};

class ForeignSamples : public ::testing::Test {
 protected:
  ForeignSamples() {
    reading.bind(servo.command);
    reading.bind(servo.feedback);
    reading.bind(servo.temperature);
  }
  ~ForeignSamples() override { reading.stop(); }

  static stage::AxisCommand order(std::uint32_t cell, std::uint32_t axis, std::uint64_t id) {
    stage::AxisCommand command;
    command.cell(cell);
    command.axis(axis);
    command.id(id);
    command.kind(stage::AXIS_COMMAND_HOME);
    return command;
  }
  Writer<stage::AxisCommand> commander(Node& node, std::int64_t strength) {
    Profile profile = node.profile("command");
    profile.strength = strength;
    return node.writer<stage::AxisCommand>(servo.command.topic, profile);
  }
  std::string told() {
    for (const auto& alarm : reading.take_alarms()) told_ += alarm.text + "\n";
    return told_;
  }

  Servo servo;
  Node reading{local("reading"), standard_profiles()};
  Node foreign{local("foreign"), standard_profiles()};

 private:
  std::string told_;
};

TEST_F(ForeignSamples, AKeyOfAnotherCellOrAxisCommandsNothingWhateverItsStrengthAndIsTold) {
  Node owner{local("owner"), standard_profiles()};
  auto job = commander(owner, 10);
  ASSERT_TRUE(eventually([&] {
    job.write(order(1, 0, 1));
    return !servo.take().empty();
  }));
  for (const std::int64_t strength : {1, 100}) {
    auto writer = commander(foreign, strength);
    ASSERT_TRUE(eventually([&] { return writer.connection().matched() == 1; }));
    const std::uint64_t before = servo.command.lost();
    ASSERT_TRUE(eventually([&] {
      writer.write(order(7, 0, 2));
      writer.write(order(1, 1, 3));
      return servo.command.lost() >= before + 2;
    })) << "refusals are counted, strength "
        << strength;
    (void)writer.connection().wait_for_acknowledgments(Duration::seconds(5.0));
    for (const auto id : servo.take()) EXPECT_EQ(id, 1U) << "strength " << strength;
  }
  job.write(order(1, 0, 4));
  EXPECT_TRUE(eventually([&] {
    const auto ids = servo.take();
    return !ids.empty() && ids.back() == 4;
  })) << "a foreign key claims nothing";
  EXPECT_THAT(told(), AllOf(HasSubstr("`invar/test/foreign`"), HasSubstr("`cell/test/servo/command`"),
                            HasSubstr("cell 7, axis 0"), HasSubstr("takes cell 1, axis 0")));
}

TEST_F(ForeignSamples, TenThousandRandomKeysDisturbNoOwnerAndTakeNoMemory) {
  const auto seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  std::mt19937 random{seed};
  Node owner{local("owner"), standard_profiles()};
  auto job = commander(owner, 10);
  ASSERT_TRUE(eventually([&] { return job.connection().matched() == 1; }));
  // Each writer keeps the samples of its instances; a new one begins anew, so that only what the reader keeps is left.
  constexpr std::uint64_t keys_a_writer = 250;
  const auto flood = [&](int writers) {
    for (int i = 0; i < writers; ++i) {
      const std::uint64_t before = servo.command.lost();
      auto writer = commander(foreign, 11);
      ASSERT_TRUE(eventually([&] { return writer.connection().matched() == 1; }));
      ASSERT_TRUE(eventually([&] {  // a first one that is lost before the reader's side of the match
        writer.write(order(7, 0, 9));
        return servo.command.lost() > before;
      }));
      for (std::uint64_t k = 0; k < keys_a_writer; ++k)
        writer.write(order(2U + static_cast<std::uint32_t>(random() % 1000000U),
                           static_cast<std::uint32_t>(random()), 9));
      ASSERT_TRUE(eventually([&] { return servo.command.lost() >= before + keys_a_writer; }));
    }
  };
  flood(10);
  const std::size_t before = mallinfo2().uordblks;
  flood(30);
  EXPECT_GE(servo.command.lost(), 10'000U);
  EXPECT_LT(static_cast<double>(mallinfo2().uordblks) - static_cast<double>(before), 1e6);
  EXPECT_TRUE(servo.take().empty());
  ASSERT_TRUE(eventually([&] {
    job.write(order(1, 0, 5));
    return !servo.take().empty();
  })) << "the right key finds room among the wrong ones";
}

TEST_F(ForeignSamples, AnInputOfTheLoopHearsItsAxisAfterManyForeignKeys) {
  Profile many = foreign.profile("realtime");
  many.max_instances = 2000;  // of the writer; the reader has room for 64
  auto writer = foreign.writer<stage::AxisFeedback>(servo.feedback.topic, many);
  stage::AxisFeedback sample;
  std::uint32_t key = 2;
  ASSERT_TRUE(eventually([&] {
    sample.cell(key++);  // more of them than the profile has instances
    writer.write(sample);
    return servo.feedback.lost() > 500;
  }));
  EXPECT_EQ(servo.feedback.latest(), nullptr);
  sample.cell(1);
  // The instances of the writer are its own matter: another one, of the same process.
  auto right = foreign.writer<stage::AxisFeedback>(servo.feedback.topic, "realtime");
  EXPECT_TRUE(eventually([&] {
    right.write(sample);
    return servo.feedback.latest() != nullptr;
  }));
}

TEST_F(ForeignSamples, ATemperatureOfAnotherNodeIsNotTakenAndOneThatIsNoNumberIs) {
  auto writer = foreign.writer<thermal::NodeTemperature>(servo.temperature.topic, "state");
  thermal::NodeTemperature sample;
  sample.cell(1);
  sample.node(8);
  sample.temperature(99.0);
  ASSERT_TRUE(eventually([&] {
    writer.write(sample);
    return servo.temperature.lost() > 0;
  }));
  EXPECT_EQ(servo.temperature.latest(), nullptr);
  sample.node(7);
  sample.temperature(std::numeric_limits<double>::quiet_NaN());  // not known yet, by the IDL
  EXPECT_TRUE(eventually([&] {
    writer.write(sample);
    return servo.temperature.latest() != nullptr;
  }));
}

TEST_F(ForeignSamples, AFeedbackThatIsNoNumberIsNotTakenAndItsMemberIsNamed) {
  auto writer = foreign.writer<stage::AxisFeedback>(servo.feedback.topic, "realtime");
  stage::AxisFeedback sample;
  sample.cell(1);
  for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    const std::uint64_t before = servo.feedback.lost();
    sample.velocity(value);
    ASSERT_TRUE(eventually([&] {
      writer.write(sample);
      return servo.feedback.lost() > before;
    }));
  }
  EXPECT_EQ(servo.feedback.latest(), nullptr);
  EXPECT_THAT(told(), AllOf(HasSubstr("`velocity`"), HasSubstr("no finite number")));
}

TEST(CommandGateClocks, ASenderAheadIsObeyedToldOnceAndItsLateSamplesAreKnown) {
  Discovery discovery;
  discovery.add_participant("p", "plant");
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery};
  const Duration ahead = Duration::seconds(3.0);
  EXPECT_TRUE(gate.passes("p|1", system_now() + ahead));
  EXPECT_TRUE(gate.passes("p|1", system_now() + ahead));
  EXPECT_FALSE(gate.passes("p|1", system_now() + ahead - Duration::seconds(1.5))) << "1.5 s on its way";
  EXPECT_TRUE(gate.passes("p|1", system_now())) << "its clock was set right";
  std::string told;
  for (const auto& alarm : discovery.take_alarms()) told += alarm.text + "\n";
  EXPECT_THAT(told, AllOf(HasSubstr("is 3 s ahead of"), HasSubstr("NTP")));
}

TEST(CommandGateClocks, ASenderBehindIsRefusedAndTheDifferenceIsNamed) {
  Discovery discovery;
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery};
  EXPECT_FALSE(gate.passes("p|1", system_now() - Duration::seconds(3600.0)));
  const auto alarms = discovery.take_alarms();
  ASSERT_EQ(alarms.size(), 1U);
  EXPECT_THAT(alarms[0].text, HasSubstr("3600 s behind"));
}

TEST(CommandGateClocks, ASenderThatWasJustFoundCannotBeLateSoThatItsClockIsBehind) {
  Discovery discovery;
  discovery.add_participant("p", "plant");
  discovery.add_endpoint({.id = "p|1",
                          .participant = "plant",
                          .topic = "cell/test/c",
                          .type = "T",
                          .is_writer = true,
                          .is_local = false,
                          .qos = {}});
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery};
  const Duration behind = Duration::seconds(3.0);
  EXPECT_TRUE(gate.passes("p|1", system_now() - behind));
  EXPECT_TRUE(gate.passes("p|1", system_now() - behind));
  EXPECT_FALSE(gate.passes("p|1", system_now() - behind - Duration::seconds(1.5))) << "1.5 s on its way";
  std::string told;
  for (const auto& alarm : discovery.take_alarms()) told += alarm.text + "\n";
  EXPECT_THAT(told, HasSubstr("is 3 s behind that of"));
}

// Its clock was right, or ahead, when somebody set it back: it shall not be refused for ever, and not before it is sure.
TEST(CommandGateClocks, ASenderWhoseClockIsSetBackIsRefusedForAWhileToldAndThenObeyed) {
  for (const double before : {0.0, 10.0}) {
    Discovery discovery;
    discovery.add_participant("p", "plant");
    const Duration patience = Duration::milliseconds(400);
    CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery, {}, patience};
    EXPECT_TRUE(gate.passes("p|1", system_now() + Duration::seconds(before)));
    const Instant set = monotonic_now();
    const Duration back = Duration::seconds(before - 5.0);
    bool passes = false;
    while (!passes && monotonic_now() - set < Duration::seconds(5.0)) {
      passes = gate.passes("p|1", system_now() + back);
      std::this_thread::sleep_for(std::chrono::milliseconds{20});
    }
    EXPECT_TRUE(passes);
    EXPECT_GE(monotonic_now() - set, patience);
    EXPECT_TRUE(gate.passes("p|1", system_now() + back)) << "and from then on";
    EXPECT_FALSE(gate.passes("p|1", system_now() + back - Duration::seconds(1.5))) << "1.5 s on its way";
    std::string told;
    for (const auto& alarm : discovery.take_alarms()) told += alarm.text + "\n";
    EXPECT_THAT(told, HasSubstr("are taken from now on: somebody set its clock"));
  }
}

TEST(CommandGateClocks, AQueueThatRunsEmptyIsNoClockThatWasSet) {
  Discovery discovery;
  CommandGate gate{
      "cell/test/c", standard_profiles().at("command"), discovery, {}, Duration::milliseconds(200)};
  // For a second, samples of the seconds before: each is younger than the one before.
  for (int age_ms = 30'000; age_ms > 1'100; age_ms -= 1'200) {
    EXPECT_FALSE(gate.passes("p|1", system_now() - Duration::milliseconds(age_ms)) && age_ms > 2'500)
        << age_ms;
    std::this_thread::sleep_for(std::chrono::milliseconds{40});
  }
  EXPECT_TRUE(gate.passes("p|1", system_now()));
}

TEST(CommandGateClocks, ASenderOfTheCellThatStampsInTheFutureIsToldSo) {
  Discovery discovery;
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery};
  EXPECT_FALSE(gate.passes("p|1", utc_now() + Duration::seconds(4.0), CommandGate::Sender::of_cell));
  EXPECT_FALSE(gate.passes("p|2", utc_now() - Duration::seconds(4.0), CommandGate::Sender::of_cell));
  const auto alarms = discovery.take_alarms();
  ASSERT_EQ(alarms.size(), 2U);
  EXPECT_THAT(alarms[0].text,
              AllOf(HasSubstr("lies 4 s in the future"), Not(HasSubstr("before it arrived"))));
  EXPECT_THAT(alarms[1].text, HasSubstr("was sent 4 s before it arrived"));
}

// A command of a person is a client of its own: a cell that runs for years hears millions.
TEST(Requests, EachClientIsHeardAndLeavesNoMemoryBehind) {
  Node server{local("server"), standard_profiles()}, clients{local("clients"), standard_profiles()};
  std::atomic<std::uint64_t> came{0};
  const auto reader = server.reader<transfer::ModelRequest>("cell/test/model_request", "request",
                                                            [&](const auto&) { ++came; });
  std::uint64_t client = 0;
  const auto call = [&](int writers) {
    for (int i = 0; i < writers; ++i) {
      auto writer = clients.writer<transfer::ModelRequest>("cell/test/model_request", "request");
      ASSERT_TRUE(eventually([&] { return writer.connection().matched() == 1; }));
      const std::uint64_t before = came;
      transfer::ModelRequest request;
      ASSERT_TRUE(eventually([&] {  // a first one that is lost before the reader's side of the match
        request.client(++client);
        writer.write(request);
        return came > before;
      }));
      const std::uint64_t first = came;
      constexpr std::uint64_t calls = 80;
      for (std::uint64_t k = 0; k < calls; ++k) {
        request.client(++client);
        writer.write(request);
      }
      ASSERT_TRUE(eventually([&] { return came >= first + calls; }));
    }
  };
  call(3);
  const std::size_t before = mallinfo2().uordblks;
  call(8);
  EXPECT_LT(static_cast<double>(mallinfo2().uordblks) - static_cast<double>(before), 2e5);
}

}  // namespace
}  // namespace invar::dds
