// CommanderWatch: who is silent, who has ended, and who is merely held up.
#include "core/dds/commander_watch.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "core/base/clock.hpp"

namespace invar::dds {
namespace {

struct Obedient final : Component {
  Input<commander::Link> link{*this, "commander", {.optional = true}};
  void step(const Tick&) noexcept override {}
};

class Commanders : public ::testing::Test {
 protected:
  Commanders() {
    profile.exclusive = true;
    profile.lease = Duration::seconds(2.0);
    gate = std::make_unique<CommandGate>("cell/t/x/command", profile, discovery);
    watch.add(*gate, obedient.link, utc_now);
  }
  void beat(const std::string& participant, const std::string& address, std::uint32_t pid = 1) {
    commander::Heartbeat sample;
    sample.participant(participant);
    sample.process("trials");
    sample.address(address);
    sample.process_id(pid);
    watch.heard(sample);
  }
  void command(const std::string& participant) {
    ASSERT_TRUE(gate->passes(participant + "|1", Instant{utc_now()}));
  }
  void look(int times) {
    for (int i = 0; i < times; ++i) watch.look();
  }
  std::int64_t silent_ms() { return obedient.link.latest()->silence_ns() / 1'000'000; }
  bool has_ended() { return obedient.link.latest()->silence_ns() == CommanderWatch::ended; }

  Profile profile;
  Discovery discovery;
  Obedient obedient;
  CommanderWatch watch{"10.0.0.1"};
  std::unique_ptr<CommandGate> gate;
};

TEST_F(Commanders, OneOnAnotherPcIsSilentForTheWakingsSinceItsHeartbeat) {
  beat("a", "10.0.0.2");
  command("a");
  look(16);
  EXPECT_EQ(silent_ms(), 80);
  EXPECT_STREQ(obedient.link.latest()->who().c_str(), "`trials` on 10.0.0.2");
  beat("a", "10.0.0.2");
  look(2);
  EXPECT_EQ(silent_ms(), 10);
}

TEST_F(Commanders, ACommandIsASignOfLife) {
  beat("a", "10.0.0.2");
  look(100);
  command("a");
  EXPECT_EQ(silent_ms(), 0);
}

TEST_F(Commanders, SomebodyElsesHeartbeatSaysNothing) {
  beat("a", "10.0.0.2");
  command("a");
  for (int i = 0; i < 20; ++i) beat("b", "10.0.0.3"), look(1);
  EXPECT_EQ(silent_ms(), 100);
}

TEST_F(Commanders, OneOnThisPcIsLostOnlyWhenItsProcessHasEnded) {
  const pid_t child = fork();
  if (child == 0) {
    pause();
    _exit(0);
  }
  beat("a", "10.0.0.1", static_cast<std::uint32_t>(child));
  command("a");
  look(1000);
  EXPECT_EQ(silent_ms(), 0) << "a loaded PC stops nothing";
  kill(child, SIGKILL);
  siginfo_t ended;
  waitid(P_PID, static_cast<id_t>(child), &ended,
         WEXITED | WNOWAIT);  // a zombie: nobody has asked for it yet
  look(1);
  EXPECT_GT(silent_ms(), 1000);
  waitpid(child, nullptr, 0);
}

TEST_F(Commanders, OneWithoutHeartbeatIsLostWhenItsWriterIs) {
  command("plant");
  look(1000);
  EXPECT_EQ(silent_ms(), 0);
  gate->gone("plant|1");
  EXPECT_TRUE(has_ended());
  look(10);
  EXPECT_TRUE(has_ended());
  command("plant");
  EXPECT_EQ(silent_ms(), 0);
}

TEST_F(Commanders, TheEndOfOneWhoDoesNotCommandSaysNothing) {
  beat("a", "10.0.0.2");
  command("a");
  gate->gone("b|1");
  EXPECT_EQ(silent_ms(), 0);
}

TEST_F(Commanders, OneThatIsBackIsHeard) {
  beat("a", "10.0.0.2");
  command("a");
  gate->gone("a|1");  // its lease ran out
  look(400);
  EXPECT_TRUE(has_ended());
  beat("a", "10.0.0.2");
  look(1);
  EXPECT_EQ(silent_ms(), 5);
}

}  // namespace
}  // namespace invar::dds
