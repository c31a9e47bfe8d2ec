// The connection against devices that misbehave byte by byte: each is named by its cause, and readings still come.
#include "core/modbus/link.hpp"

#include <gmock/gmock.h>

#include "core/base/clock.hpp"
#include "core/modbus/endpoint.hpp"
#include "tests/support/modbus_peer.hpp"

namespace invar::modbus {
namespace {

using test::Bytes;
using test::ModbusPeer;
using test::Talk;

/// A peer and the link to it.
struct Bench {
  explicit Bench(ModbusPeer::Answer answer, int timeout_ms = 2000)
      : peer{std::move(answer)}, link{"127.0.0.1", peer.port} {
    EXPECT_FALSE(link.open(Duration::seconds(5)));
    link.address(1, Duration::milliseconds(timeout_ms));
  }
  Outcome read(unsigned count = 4) {
    words.assign(count, 0);
    return link.read(Kind::holding, 10, words);
  }
  /// Whether a read brings what the device holds.
  bool reads(unsigned count = 4) {
    if (read(count)) return false;
    for (unsigned i = 0; i < count; ++i)
      if (words[i] != 1010 + i) return false;
    return true;
  }
  Outcome write() {
    const std::uint16_t value = 5;
    return link.write(Kind::holding, 10, {&value, 1});
  }

  ModbusPeer peer;
  Link link;
  std::vector<std::uint16_t> words;
};

void be_honest(const Talk& talk) { talk.send(talk.honest()); }

TEST(Link, DeviceThatClosesAfterEachAnswerIsReadAndWrittenWithoutLoss) {
  Bench bench{[](Talk& talk) {
    be_honest(talk);
    talk.close();
  }};
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(bench.reads()) << i;
  EXPECT_TRUE(bench.link.counters().one_answer);
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(bench.write()) << i;
  EXPECT_EQ(bench.peer.writes, 20);
  EXPECT_EQ(bench.link.counters().losses, 0U);
  EXPECT_TRUE(bench.reads());
}

TEST(Link, DeviceThatClosesWhileIdleGetsANewConnectionBeforeTheNextRequest) {
  Bench bench{be_honest};
  bench.peer.idle_ms = 20;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(bench.reads());
    Talk::wait(80);
    EXPECT_FALSE(bench.write());
  }
  EXPECT_EQ(bench.peer.writes, 4);
  EXPECT_GE(bench.link.counters().closings, 4U);
  EXPECT_EQ(bench.link.counters().losses, 0U);
  EXPECT_FALSE(bench.link.counters().one_answer);
}

TEST(Link, AnswerOfAByteEach5MillisecondsIsWaitedForBeyondTheTimeoutForItsBegin) {
  Bench bench{[](Talk& talk) { talk.trickle(talk.honest(), 5); }, 250};
  EXPECT_TRUE(bench.reads(60));  // 129 bytes: 0.65 s, and up to 2.8 on a busy host
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.link.counters().losses, 0U);
}

TEST(Link, AnswerThatNeverEndsIsGivenUp) {
  Bench bench{[](Talk& talk) {
                Bytes header{talk.request[0], talk.request[1], 0, 0, 0, 250, 1};
                talk.send(header);
                for (int i = 0; i < 100 && !talk.is_closed(); ++i) talk.trickle({0}, 20);
              },
              100};
  const Instant begin = monotonic_now();
  EXPECT_EQ(bench.read()->cause, Cause::short_answer);
  // 100 ms and 20 ms for each of the 17 bytes of the answer that was asked for, and a busy host.
  EXPECT_LT((monotonic_now() - begin).in_seconds(), 5.0);
}

TEST(Link, LateAnswerIsNotTakenForTheNextOne) {
  Bench bench{[](Talk& talk) {
                if (talk.number == 2) Talk::wait(300);
                Bytes answer = talk.honest();
                if (talk.number == 2) answer[10] = 99;  // would be seen if it were taken
                talk.send(answer);
              },
              200};
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.read()->cause, Cause::timeout);
  bench.link.address(1, Duration::seconds(5));
  EXPECT_TRUE(bench.reads());
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.link.counters().late, 1U);
  EXPECT_GE(bench.link.counters().latest, Duration::milliseconds(250));
  EXPECT_EQ(bench.link.counters().losses, 0U);
  EXPECT_EQ(bench.peer.connections, 1);
}

TEST(Link, LateAnswersOfMoreRequestsThanAreRememberedAreDroppedOnlyWhileTheyWereAsked) {
  Bench bench{[](Talk& talk) {
    Bytes answer = talk.honest();
    Bytes never = answer;
    never[0] = 0x77;  // a transaction that nobody asked for
    talk.send(talk.number == 2 ? never : answer);
  }};
  EXPECT_TRUE(bench.reads());
  const auto failed = bench.read();
  EXPECT_EQ(failed->cause, Cause::malformed);
  EXPECT_EQ(failed->flaw, Flaw::transaction);
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.peer.connections, 2);
}

TEST(Link, EachWrongFieldIsMalformedUnderItsNameAndTheNextReadIsSound) {
  struct Wrong {
    std::size_t at;
    std::uint8_t to;
    Flaw flaw;
  };
  for (const auto& [at, to, flaw] :
       {Wrong{2, 1, Flaw::protocol}, Wrong{3, 1, Flaw::protocol}, Wrong{4, 1, Flaw::length},
        Wrong{5, 2, Flaw::length}, Wrong{5, 10, Flaw::length}, Wrong{6, 0, Flaw::unit},
        Wrong{6, 255, Flaw::unit}, Wrong{6, 2, Flaw::unit}, Wrong{7, 4, Flaw::function},
        Wrong{7, 6, Flaw::function}, Wrong{8, 9, Flaw::byte_count}, Wrong{8, 6, Flaw::byte_count},
        Wrong{8, 0, Flaw::byte_count}}) {
    Bench bench{[&, at = at, to = to](Talk& talk) {
      Bytes answer = talk.honest();
      if (talk.connection == 1) answer[at] = to;
      talk.send(answer);
    }};
    const auto failed = bench.read();
    ASSERT_TRUE(failed) << at << " " << int{to};
    EXPECT_EQ(failed->cause, Cause::malformed) << at << " " << int{to};
    EXPECT_EQ(failed->flaw, flaw) << at << " " << int{to} << " " << name_of(failed->flaw);
    EXPECT_TRUE(bench.reads());
  }
}

TEST(Link, SegmentsMayPartAndJoinAnswers) {
  Bench bench{[](Talk& talk) {
    const Bytes answer = talk.honest();
    if (talk.number == 2) {  // in two segments, parted within the header
      talk.send({answer.begin(), answer.begin() + 3});
      Talk::wait(30);
      talk.send({answer.begin() + 3, answer.end()});
    } else if (talk.number == 3) {  // twice in one segment
      Bytes twice = answer;
      twice.insert(twice.end(), answer.begin(), answer.end());
      talk.send(twice);
    } else if (talk.number == 4) {  // with a checksum behind it, as a serial line has
      Bytes more = answer;
      more.insert(more.end(), {0xCA, 0xFE});
      talk.send(more);
    } else {
      talk.send(answer);
    }
  }};
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(bench.reads()) << i;
  EXPECT_EQ(bench.link.counters().late, 1U);
  EXPECT_EQ(bench.link.counters().stray, 1U);
  EXPECT_EQ(bench.link.counters().losses, 0U);
  EXPECT_EQ(bench.peer.connections, 1);
}

TEST(Link, ConnectionThatIsResetWithinAnAnswerIsMadeAnew) {
  Bench bench{[](Talk& talk) {
    const Bytes answer = talk.honest();
    if (talk.connection == 1 && talk.number == 3) {
      talk.send({answer.begin(), answer.begin() + 9});
      Talk::wait(50);
      talk.reset();
    } else if (talk.connection == 2 && talk.number == 3) {
      talk.reset();
    } else {
      talk.send(answer);
    }
  }};
  EXPECT_TRUE(bench.reads() && bench.reads());
  EXPECT_EQ(bench.read()->cause, Cause::short_answer);
  EXPECT_TRUE(bench.reads() && bench.reads());
  EXPECT_EQ(bench.read()->cause, Cause::reset);
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.link.counters().losses, 2U);
}

TEST(Link, SilentConnectionIsGivenUpAfterTwoTimeouts) {
  Bench bench{[](Talk& talk) {
                if (talk.connection == 1 && talk.number > 1) return;  // the cable is pulled
                be_honest(talk);
              },
              100};
  bench.peer.idle_ms = 400;  // so that the peer comes to the next connection
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.read()->cause, Cause::timeout);
  EXPECT_TRUE(bench.link.is_open());
  EXPECT_EQ(bench.read()->cause, Cause::timeout);
  EXPECT_FALSE(bench.link.is_open());
  bench.link.address(1, Duration::seconds(5));
  EXPECT_TRUE(bench.reads());
}

TEST(Link, FloodThatNobodyAskedForIsLetGo) {
  Bench bench{[](Talk& talk) {
    be_honest(talk);
    if (talk.connection > 1) return;
    const Bytes chatter(4096, 0);
    for (int i = 0; i < 40; ++i) talk.send(chatter);
  }};
  EXPECT_TRUE(bench.reads());
  Talk::wait(50);
  bool came = false;
  for (int i = 0; i < 5 && !came; ++i) came = bench.reads();
  EXPECT_TRUE(came);
}

TEST(Link, WriteWhoseConnectionEndsIsNotRepeated) {
  Bench bench{[](Talk& talk) {
    if (talk.function() > 4)
      talk.reset();
    else
      be_honest(talk);
  }};
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.write()->cause, Cause::reset);
  EXPECT_TRUE(bench.reads());
  EXPECT_EQ(bench.peer.writes, 1);
}

TEST(Link, NobodyThereIsRefused) {
  std::uint16_t port = 0;
  {
    const ModbusPeer gone{be_honest};
    port = gone.port;
  }
  Link link{"127.0.0.1", port};
  EXPECT_EQ(link.open(Duration::seconds(5))->cause, Cause::refused);
  EXPECT_EQ(link.counters().refused, 1U);
  Link nowhere{"no.such.host.invalid", 502};
  EXPECT_EQ(nowhere.open(Duration::milliseconds(100))->cause, Cause::unreachable);
}

}  // namespace
// Other spellings that inet_aton(3) takes for an address, and what no resolver should see.
TEST(Host, IsANameOrAnAddressInFull) {
  for (const char* good :
       {"127.0.0.1", "10.0.0.5", "::1", "localhost", "plc-3.hall.example", "pad_heater", "7plc"})
    EXPECT_TRUE(is_host(good)) << good;
  for (const char* bad : {"", "127.1", "0177.0.0.1", "2130706433", "0x7f000001", "127.0.0.1 ", "127.0.0.1;id",
                          "$(id)", "10.0.0.256", "host."})
    EXPECT_FALSE(is_host(bad)) << bad;
}

}  // namespace invar::modbus
