#include "core/dds/ownership.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <set>

#include "core/dds/command_gate.hpp"
#include "core/dds/peer_address.hpp"
#include "domain.hpp"
#include "idl/types.hpp"

namespace invar::dds {
namespace {

using ::testing::AllOf;
using testing::eventually;
using ::testing::HasSubstr;
using testing::local;

Instant at(double seconds) { return Instant{} + Duration::seconds(seconds); }
Claimant of(const std::string& process, std::int64_t strength, const std::string& writer = "1") {
  return {process + "|" + writer, process, strength};
}

class Owners : public ::testing::Test {
 protected:
  bool obeys(const Claimant& who, double seconds) { return ownership.claim(who, at(seconds)) == nullptr; }
  std::set<std::string> gone;
  Ownership ownership{Duration::seconds(2.0),
                      [this](const Claimant& owner) { return gone.contains(owner.participant); }};
};

TEST_F(Owners, TheGreaterStrengthCommandsUntilItEnds) {
  EXPECT_TRUE(obeys(of("standby", 5), 0.0));
  EXPECT_TRUE(obeys(of("master", 10), 0.1));
  EXPECT_FALSE(obeys(of("standby", 5), 0.2));
  EXPECT_FALSE(obeys(of("standby", 5), 1000.0)) << "a master that has nothing to say is a master";
  ownership.release("master|1");
  EXPECT_TRUE(obeys(of("standby", 5), 1000.1));
}

TEST_F(Owners, WhoeverIsGoneStandsInNobodysWay) {
  EXPECT_TRUE(obeys(of("a", 10), 0.0));
  EXPECT_FALSE(obeys(of("b", 10), 0.1));
  gone.insert("a");
  EXPECT_TRUE(obeys(of("b", 10), 0.2));
}

TEST_F(Owners, OfEqualsTheFirstCommandsWhileItIsAtWork) {
  EXPECT_TRUE(obeys(of("a", 10), 0.0));
  EXPECT_FALSE(obeys(of("b", 10), 1.9));
  EXPECT_TRUE(obeys(of("a", 10), 1.95));
  EXPECT_FALSE(obeys(of("b", 10), 3.9));
  EXPECT_TRUE(obeys(of("b", 10), 3.95));
  EXPECT_FALSE(obeys(of("a", 10), 4.0));
}

TEST_F(Owners, WritersOfOneProcessAreOneMaster) {
  EXPECT_TRUE(obeys(of("a", 10, "1"), 0.0));
  EXPECT_TRUE(obeys(of("a", 10, "2"), 0.1));
  ownership.release("a|1");
  EXPECT_FALSE(obeys(of("b", 10), 0.2)) << "its other writer commanded last";
}

/// A socket of the loopback on which somebody receives, and its address.
void listen(int& end, PeerAddress& peer) {
  end = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(end, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  socklen_t size = sizeof address;
  ASSERT_EQ(getsockname(end, reinterpret_cast<sockaddr*>(&address), &size), 0);
  peer = {"127.0.0.1", ntohs(address.sin_port)};
}

TEST(PeerAddress, IsAbandonedWhereNobodyReceives) {
  int end = -1;
  PeerAddress peer;
  ASSERT_NO_FATAL_FAILURE(listen(end, peer));
  EXPECT_FALSE(are_abandoned({peer}));
  close(end);
  // The kernel may take its time; that it ever says so of an abandoned port is the point.
  EXPECT_TRUE(eventually([&] { return are_abandoned({peer}); }));
  EXPECT_FALSE(are_abandoned({})) << "nothing is known";
  EXPECT_FALSE(are_abandoned({peer, {"no address", 1}})) << "not sure of all";
}

// Cyclone DDS receives for all participants of a process at one address: the later is no successor of the earlier.
TEST(Discovery, OneIsGoneWhereAnotherProcessTookItsAddressAndNotWhereItsOwnHasASecondParticipant) {
  int end = -1;
  PeerAddress peer;
  ASSERT_NO_FATAL_FAILURE(listen(end, peer));
  Discovery discovery;
  const std::string first = "01.10.5c.01.aa.aa.aa.aa.aa.aa.aa.aa",
                    second = "01.10.5c.01.bb.bb.bb.bb.bb.bb.bb.bb",
                    successor = "01.10.77.02.cc.cc.cc.cc.cc.cc.cc.cc";
  discovery.add_participant(first, "plant", {peer});
  discovery.add_participant(second, "plant", {peer});
  EXPECT_FALSE(discovery.is_gone(first));
  discovery.add_participant(successor, "plant", {peer});
  EXPECT_TRUE(discovery.is_gone(first));
  EXPECT_TRUE(discovery.is_gone(second));
  EXPECT_FALSE(discovery.is_gone(successor));
  close(end);
}

TEST(CommandGate, RefusesWhatIsTooOldAndSaysSo) {
  Discovery discovery;
  discovery.add_participant("p", "plant");
  int refused = 0;
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery, [&] { ++refused; }};
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const Instant sent{std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()};
  EXPECT_FALSE(gate.passes("p|1", sent - Duration::seconds(3.0)));
  EXPECT_TRUE(gate.passes("p|1", sent));
  EXPECT_EQ(refused, 1);
  const auto alarms = discovery.take_alarms();
  ASSERT_EQ(alarms.size(), 1U);
  EXPECT_FALSE(alarms[0].fault);
  EXPECT_THAT(alarms[0].text,
              AllOf(HasSubstr("a command of `plant` on `cell/test/c` was not obeyed"), HasSubstr("sent 3"),
                    HasSubstr("lifespan"), HasSubstr("clock of the sender")));
}

TEST(CommandGate, TellsOfMoreRefusalsNowAndThen) {
  Discovery discovery;
  CommandGate gate{"cell/test/c", standard_profiles().at("command"), discovery};
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(gate.passes("p|1", Instant{}));
  EXPECT_EQ(gate.refused(), 100U);
  EXPECT_EQ(discovery.take_alarms().size(), 1U);
}

// Fast DDS alone drops the second one's commands in silence, or the first one's: the lower GUID wins.
TEST(CommandGate, TwoMastersOfOneInboxOneIsObeyedTheOtherIsToldAndCounted) {
  struct Destination final : Component {
    Inbox<stage::AxisCommand> command{*this, "command"};
    void step(const Tick&) noexcept override {}
  } destination;
  destination.command.topic = "cell/test/axis/command";
  Node reading{local("reading"), standard_profiles()};
  reading.bind(destination.command);
  const auto take = [&](std::uint64_t id) {
    bool found = false;
    for (stage::AxisCommand taken; destination.command.take(taken);) found = found || taken.id() == id;
    return found;
  };
  auto one = std::make_unique<Node>(local("one"), standard_profiles());
  Node other{local("other"), standard_profiles()};
  auto first = std::make_unique<Writer<stage::AxisCommand>>(
      one->writer<stage::AxisCommand>("cell/test/axis/command", "command"));
  auto second = other.writer<stage::AxisCommand>("cell/test/axis/command", "command");
  stage::AxisCommand command;
  command.id(1);
  ASSERT_TRUE(eventually([&] {
    first->write(command);
    return take(1);
  }));
  std::string told;
  command.id(2);
  ASSERT_TRUE(eventually([&] {
    command.id(3);
    first->write(command);  // at work
    command.id(2);
    second.write(command);
    EXPECT_FALSE(take(2));
    for (const auto& alarm : reading.take_alarms()) told += alarm.text;
    return !told.empty();
  }));
  EXPECT_THAT(told, AllOf(HasSubstr("a command of `invar/test/other`"),
                          HasSubstr("`invar/test/one` commands there"), HasSubstr("strength 10")));
  EXPECT_GT(destination.command.lost(), 0U);
  first.reset();
  EXPECT_TRUE(eventually([&] {
    second.write(command);
    return take(2);
  })) << "the other has ended";
  reading.stop();
}

}  // namespace
}  // namespace invar::dds
