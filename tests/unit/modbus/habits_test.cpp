// What devices do besides answering, seen from a device's owner: busy, gateways, functions and registers that it lacks.
#include <gmock/gmock.h>

#include <functional>
#include <mutex>
#include <set>

#include "core/base/clock.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/grouping.hpp"
#include "core/modbus/health.hpp"
#include "tests/support/modbus_peer.hpp"

namespace invar::modbus {
namespace {

using test::Bytes;
using test::ModbusPeer;
using test::Talk;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

RegisterMap wide_map(const std::string& more = "gaps: readable\npoll: 0.02\n", int unit = 1) {
  return parse_map("invar_modbus_map: 1\ndevice: oven\nunit: " + std::to_string(unit) +
                       "\ntimeouts: {answer: 5, write: 2, read_back: 1, stale: 10}\n" + more +
                       "registers:\n"
                       "  a: {address: 0, kind: holding, type: uint16, access: read}\n"
                       "  b: {address: 1, kind: holding, type: uint16, access: read}\n"
                       "  c: {address: 4, kind: holding, type: uint32, access: read}\n"
                       "  d: {address: 9, kind: holding, type: uint16, access: read}\n"
                       "  level: {address: 20, kind: holding, type: uint16, access: read_write,\n"
                       "          role: setting}\n"
                       "  lamp: {address: 3, kind: coil, type: bool, access: read_write, role: setting}\n",
                   "oven.yaml");
}

bool comes_true(const std::function<bool()>& fact) {
  const Instant watchdog = monotonic_now() + Duration::seconds(60);
  while (!fact()) {
    if (monotonic_now() > watchdog) return false;
    Talk::wait(2);
  }
  return true;
}

void be_honest(const Talk& talk) { talk.send(talk.honest()); }

/// A device and its owner; the bus runs in its own thread.
struct Bench {
  explicit Bench(ModbusPeer::Answer answer, const RegisterMap& map = wide_map())
      : peer{std::move(answer)}, bus{{.port = peer.port}}, device{bus.add(map)}, health{"here"} {}
  ~Bench() { bus.stop(); }
  bool shows_all() {
    return device.value("a").value == 1000 && device.value("b").value == 1001 &&
           device.value("c").value == 1004 * 65536.0 + 1005 && device.value("d").value == 1009 &&
           device.value("level").value == 1020;
  }
  /// Everything that its health says within so long.
  std::vector<std::string> said(int milliseconds) {
    std::vector<std::string> texts;
    for (const Instant end = monotonic_now() + Duration::milliseconds(milliseconds); monotonic_now() < end;) {
      for (const auto& change : health.look(device, bus.counters(), monotonic_now()))
        texts.push_back(change.text);
      Talk::wait(5);
    }
    return texts;
  }
  ModbusPeer peer;
  Bus bus;
  Device& device;
  Health health;
};

TEST(Habits, ReadsOfABusyDeviceAreAskedAgainSoonAndNotForEver) {
  for (const int code : {5, 6}) {
    std::atomic<int> busy{2};
    // The next poll comes after the test: only asking again brings the values.
    Bench bench{[&](Talk& talk) { talk.send(busy-- > 0 ? talk.exception(code) : talk.honest()); },
                wide_map("gaps: readable\npoll: 4\n")};
    bench.bus.start();
    EXPECT_TRUE(comes_true([&] { return bench.shows_all(); })) << code;
    EXPECT_EQ(bench.device.counters().polls, 2U);
    EXPECT_EQ(bench.device.counters().asked_again, 2U);
    EXPECT_EQ(bench.device.counters().exceptions[static_cast<std::size_t>(code)], 2U);
    EXPECT_EQ(bench.bus.counters().losses, 0U);
  }
  Bench always{[&](Talk& talk) { talk.send(talk.exception(6)); }, wide_map("gaps: readable\npoll: 4\n")};
  always.bus.start();
  EXPECT_TRUE(comes_true([&] { return always.peer.requests >= 4; }));
  Talk::wait(300);
  EXPECT_LE(always.peer.requests, 6);  // two reads, and three more tries
}

TEST(Habits, WriteToABusyDeviceIsSentAgainUntilItIsTakenOrRefusedForGood) {
  std::atomic<int> busy{3};
  Bench bench{
      [&](Talk& talk) { talk.send(talk.function() > 4 && busy-- > 0 ? talk.exception(6) : talk.honest()); }};
  bench.bus.start();
  (void)bench.device.write("level", 7);
  EXPECT_TRUE(comes_true([&] { return bench.device.last_write("level").state == WriteState::written; }));
  EXPECT_EQ(bench.peer.writes, 4);
  busy = 1'000'000;
  (void)bench.device.write("level", 8);
  EXPECT_TRUE(comes_true([&] { return bench.device.last_write("level").state == WriteState::refused; }));
  EXPECT_EQ(bench.device.last_write("level").exception, 6);
  // An owner that repeats itself every cycle does not keep it from being refused.
  EXPECT_TRUE(comes_true([&] {
    (void)bench.device.write("level", 9);
    return bench.device.last_write("level").state == WriteState::refused ||
           bench.device.counters().writes_refused > 1;
  }));
}

TEST(Habits, AcknowledgeIsNoRefusalAndTheWriteIsNotRepeated) {
  Bench bench{[](Talk& talk) { talk.send(talk.function() > 4 ? talk.exception(5) : talk.honest()); }};
  bench.bus.start();
  (void)bench.device.write("level", 7);
  EXPECT_TRUE(comes_true([&] { return bench.device.last_write("level").state == WriteState::written; }));
  Talk::wait(100);
  EXPECT_EQ(bench.peer.writes, 1);
}

TEST(Habits, UnitThatItsGatewayDoesNotReachBacksOffAndLeavesItsNeighbourAlone) {
  for (const int code : {10, 11}) {
    ModbusPeer peer{
        [&](Talk& talk) { talk.send(talk.request[6] == 1 ? talk.exception(code) : talk.honest()); }};
    Bus bus{{.port = peer.port}};
    Device& dead = bus.add(wide_map());
    Device& alive = bus.add(wide_map("gaps: readable\npoll: 0.02\n", 2));
    (void)dead.write("level", 3);
    bus.start();
    ASSERT_TRUE(comes_true([&] { return alive.counters().polls > 20; })) << code;
    EXPECT_LT(dead.counters().requests, 10U);
    EXPECT_FALSE(dead.is_online());
    EXPECT_EQ(bus.counters().losses, 0U);
    // 11: the device may have done it, and only its answer was lost.
    EXPECT_EQ(dead.last_write("level").state, code == 11 ? WriteState::uncertain : WriteState::refused);
    bus.stop();
  }
}

TEST(Habits, DeviceWithoutAFunctionForOneValueIsWrittenByTheOneForSeveral) {
  Bench bench{[](Talk& talk) {
    const bool single = talk.function() == 5 || talk.function() == 6;
    talk.send(single ? talk.exception(1) : talk.honest());
  }};
  ASSERT_TRUE(bench.bus.exchange({}));
  (void)bench.device.write("level", 7);
  (void)bench.device.write("lamp", 1);
  bench.bus.exchange(Instant{} + Duration::seconds(1));
  for (const char* reg : {"level", "lamp"})
    EXPECT_EQ(bench.device.last_write(reg).state, WriteState::written) << reg;
  EXPECT_EQ(bench.peer.writes, 3);  // the refused one, and two by 16 and 15
}

TEST(Habits, HolesInTheMapAndALimitOfRegistersAreFoundOutByPartingReads) {
  const auto has_hole = [](const Talk& talk) {
    for (unsigned at = talk.address(); at < talk.address() + talk.count(); ++at)
      if (at == 2 || at == 3 || (at > 5 && at < 9) || (at > 9 && at < 20)) return true;
    return false;
  };
  Bench holes{[&](Talk& talk) {
    talk.send(talk.function() == 3 && has_hole(talk) ? talk.exception(2) : talk.honest());
  }};
  Bench limited{[](Talk& talk) {
    talk.send(talk.function() == 3 && talk.count() > 2 ? talk.exception(3) : talk.honest());
  }};
  for (Bench* bench : {&holes, &limited}) {
    bench->bus.start();
    EXPECT_TRUE(comes_true([&] { return bench->shows_all(); }));
    EXPECT_GT(bench->device.counters().splits, 0U);
    EXPECT_THAT(bench->said(100), Contains(HasSubstr("say `max_registers` or `gaps` in its map")));
  }
}

TEST(Habits, OneRegisterThatDoesNotExistDoesNotHideTheOthers) {
  Bench bench{[](Talk& talk) {
    const bool has_b = talk.function() == 3 && talk.address() <= 1 && talk.address() + talk.count() > 1;
    talk.send(has_b ? talk.exception(2) : talk.honest());
  }};
  bench.bus.start();
  EXPECT_TRUE(comes_true([&] { return bench.device.value("d").value == 1009; }));
  EXPECT_TRUE(comes_true([&] { return bench.device.value("a").value == 1000; }));
  EXPECT_TRUE(bench.device.value("b").stale);
}

TEST(Habits, MapsLimitOfRegistersIsKeptFromTheFirstRead) {
  const RegisterMap map = wide_map("gaps: readable\npoll: 0.02\nmax_registers: 3\n");
  for (const ReadRequest& request : plan_reads(map)) EXPECT_LE(request.count, 3);
  Bench bench{[](Talk& talk) {
                talk.send(talk.function() == 3 && talk.count() > 3 ? talk.exception(3) : talk.honest());
              },
              map};
  ASSERT_TRUE(bench.bus.exchange({}));
  EXPECT_TRUE(bench.shows_all());
  EXPECT_EQ(bench.device.counters().splits, 0U);
}

TEST(Habits, UnitsOfOneGatewayShareTheProcessesOnlyConnection) {
  std::mutex mutex;
  std::set<int> units;
  ModbusPeer gateway{[&](Talk& talk) {  // serves one connection, and others never
    const std::lock_guard lock{mutex};
    units.insert(talk.request[6]);
    be_honest(talk);
  }};
  const BusOptions options{.port = gateway.port};
  std::vector<std::shared_ptr<Bus>> owners;
  std::vector<Device*> devices;
  for (int unit = 1; unit <= 4; ++unit) {
    owners.push_back(shared_bus(options, false));
    devices.push_back(&owners.back()->add(wide_map("gaps: readable\npoll: 0.02\n", unit)));
  }
  for (Device* device : devices) EXPECT_TRUE(comes_true([&] { return device->counters().polls > 3; }));
  owners[0]->remove(*devices[0]);  // the others go on
  owners[0].reset();
  const auto before = devices[3]->counters().polls;
  EXPECT_TRUE(comes_true([&] { return devices[3]->counters().polls > before + 3; }));
  EXPECT_EQ(gateway.connections, 1);
  EXPECT_THAT(units, ::testing::ElementsAre(1, 2, 3, 4));
  owners.clear();
  const auto anew = shared_bus(options, false);  // the last owner took the old one with it
  Device& again = anew->add(wide_map());
  EXPECT_TRUE(comes_true([&] { return again.counters().polls > 0; }));
  EXPECT_EQ(gateway.connections, 2);
}

TEST(Habits, AnswersThatComeLateMakeTheDeviceBeWaitedForLonger) {
  const auto map = parse_map(
      "invar_modbus_map: 1\ndevice: oven\npoll: 0.05\ntimeouts: {answer: 0.1, stale: 5}\n"
      "registers:\n  a: {address: 0, kind: holding, type: uint16, access: read}\n",
      "oven.yaml");
  Bench bench{[](Talk& talk) {
                Talk::wait(150);
                be_honest(talk);
              },
              map};
  bench.bus.start();
  EXPECT_TRUE(comes_true([&] { return bench.device.counters().polls > 3; }));
  EXPECT_GE(bench.bus.counters().late, 1U);
  EXPECT_EQ(bench.device.value("a").value, 1000.0);
}

TEST(Habits, NumbersThatAreNoneAreNotSound) {
  const auto map = parse_map(
      "invar_modbus_map: 1\ndevice: oven\nregisters:\n"
      "  a: {address: 0, kind: input, type: float32, access: read}\n"
      "  wide: {address: 2, kind: input, type: float32, scale: 1e300, access: read}\n",
      "oven.yaml");
  for (const Bytes& wrong : {Bytes{0x7F, 0xC0, 0, 0}, Bytes{0x7F, 0x80, 0, 0}, Bytes{0xFF, 0x80, 0, 0}}) {
    Bench bench{[&](Talk& talk) {
                  Bytes pdu{4, 8};
                  pdu.insert(pdu.end(), wrong.begin(), wrong.end());
                  pdu.insert(pdu.end(), wrong.begin(), wrong.end());
                  talk.send(talk.framed(pdu));
                },
                map};
    ASSERT_TRUE(bench.bus.exchange({}));
    for (const char* reg : {"a", "wide"}) {
      EXPECT_FALSE(bench.device.value(reg).is_sound()) << reg;
      EXPECT_TRUE(bench.device.value(reg).out_of_range) << reg;
    }
  }
}

/// What the health says of a device that behaves so, while its readings come.
struct Named {
  const char* name;
  ModbusPeer::Answer answer;
  const char* said;
};
void PrintTo(const Named& named, std::ostream* out) { *out << named.name; }
class Habit : public ::testing::TestWithParam<Named> {};

TEST_P(Habit, IsToldByItsCauseWhileReadingsCome) {
  Bench bench{GetParam().answer};
  bench.bus.start();
  EXPECT_TRUE(comes_true([&] { return bench.shows_all(); }));
  std::vector<std::string> said;
  EXPECT_TRUE(comes_true([&] {
    for (auto& text : bench.said(100)) said.push_back(text);
    return !said.empty();
  }));
  EXPECT_THAT(said, Contains(HasSubstr(GetParam().said)));
  EXPECT_TRUE(bench.device.value("a").is_sound());
}

bool each_third(const Talk& talk) { return talk.request[1] % 3 == 0; }

INSTANTIATE_TEST_SUITE_P(
    Device, Habit,
    ::testing::Values(
        Named{"closes",
              [](Talk& talk) {
                be_honest(talk);
                talk.close();
              },
              "closes the connection after each answer"},
        Named{"busy", [](Talk& talk) { talk.send(each_third(talk) ? talk.exception(6) : talk.honest()); },
              "says that it is busy"},
        Named{"checksum",
              [](Talk& talk) {
                Bytes more = talk.honest();
                more.push_back(7);
                talk.send(more);
              },
              "sends bytes that answer nothing"},
        Named{"wrong unit",
              [](Talk& talk) {
                Bytes answer = talk.honest();
                if (each_third(talk)) answer[6] = 9;
                talk.send(answer);
              },
              "wrong in their unit"},
        Named{"cuts",
              [](Talk& talk) {
                if (!each_third(talk)) return be_honest(talk);
                talk.send({talk.request[0]});
                talk.reset();
              },
              "ends connections in the middle of an answer"},
        Named{"trickles", [](Talk& talk) { talk.trickle(talk.honest(), 2); }, "answers slowly"}),
    [](const auto& one) { return std::string{one.param.name}.substr(0, 5); });

TEST(Habits, WhyNothingComesIsSaidInWords) {
  struct Case {
    ModbusPeer::Answer answer;
    const char* said;
  };
  for (const auto& [answer, text] :
       {Case{[](Talk& talk) { talk.close(); }, "another master may hold its only one"},
        Case{[](Talk& talk) { talk.send(talk.exception(11)); }, "the gateway hears nothing of it"},
        Case{[](Talk& talk) { talk.send(talk.exception(1)); }, "does not know the function; look at `kind`"},
        Case{[](Talk& talk) { talk.send(talk.exception(6)); }, "exception 6, it is busy"},
        Case{[](Talk& talk) {
               Bytes answer = talk.honest();
               answer[3] = 1;
               talk.send(answer);
             },
             "wrong in their protocol"}}) {
    Bench bench{answer};
    bench.bus.start();
    std::string said;
    EXPECT_TRUE(comes_true([&] {
      for (const auto& one : bench.said(100)) said += one + "\n";
      return said.find(text) != std::string::npos;
    })) << text;
    EXPECT_THAT(said, HasSubstr("does not answer"));
  }
}

TEST(Habits, ADeviceThatCameUpLateAndIsSlowIsNotSaidToBeAbsent) {
  std::uint16_t port = 0;
  {
    const ModbusPeer gone{[](Talk&) {}};
    port = gone.port;
  }
  // Six requests of 0.6 s each: at the third second some values are there and others are not.
  const RegisterMap map = parse_map(
      "invar_modbus_map: 1\ndevice: oven\npoll: 0.5\ntimeouts: {answer: 1, write: 2, read_back: 1, stale: "
      "1.5}\n"
      "registers:\n"
      "  a: {address: 0, kind: holding, type: uint16, access: read}\n"
      "  b: {address: 10, kind: holding, type: uint16, access: read}\n"
      "  c: {address: 20, kind: holding, type: uint16, access: read}\n"
      "  d: {address: 30, kind: holding, type: uint16, access: read}\n"
      "  e: {address: 40, kind: holding, type: uint16, access: read}\n"
      "  f: {address: 50, kind: holding, type: uint16, access: read}\n",
      "oven.yaml");
  Bus bus{{.port = port}};
  Device& device = bus.add(map);
  Health health{"here"};
  bus.start();
  ASSERT_TRUE(comes_true([&] { return bus.counters().refused > 0; }));
  const ModbusPeer late{[](Talk& talk) {
                          Talk::wait(600);
                          be_honest(talk);
                        },
                        port};
  std::string said;
  EXPECT_TRUE(comes_true([&] {
    for (const auto& change : health.look(device, bus.counters(), monotonic_now()))
      said += change.text + "\n";
    return !said.empty();
  }));
  bus.stop();
  EXPECT_THAT(said, HasSubstr("does not answer"));
  EXPECT_THAT(said, testing::Not(HasSubstr("nobody listens"))) << said;
}

}  // namespace
}  // namespace invar::modbus
