// The datagram that ends a program of Fast DDS 2.9.1, sent to one without the filter and to a node of ours.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <set>
#include <thread>

#include "core/dds/node.hpp"
#include "idl/types.hpp"
#include "tests/support/rtps_builder.hpp"
#include "tests/support/rtps_tap.hpp"
#include "tests/unit/dds/domain.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using ::testing::HasSubstr;
using testing::local;

/// To everybody in the domain on this PC.
class Sender {
 public:
  explicit Sender(std::uint32_t domain) {
    in_addr loopback{};
    inet_pton(AF_INET, "127.0.0.1", &loopback);
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof loopback);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain));
    inet_pton(AF_INET, "239.255.0.1", &to_.sin_addr);
  }
  ~Sender() { close(socket_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  void send(const std::vector<std::byte>& message) const {
    (void)sendto(socket_, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
                 sizeof to_);
  }

 private:
  int socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to_{};
};

/// Statistics of Fast DDS that something follows: 84 octets.
std::vector<std::byte> deadly() {
  return invar::testing::RtpsBuilder{}.begin(0x80).fill(56).begin(0x01).bytes();
}

void live_without_the_filter(std::uint32_t domain) {
  const invar::testing::RtpsTap tap{domain, "127.0.0.1"};
  const Sender sender{domain};
  for (int i = 0; i < 100; ++i) {
    sender.send(deadly());
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
  }
  std::exit(0);
}

// Where this fails the library has been mended, and the filter may let statistics pass.
TEST(ReceiveFilterDeathTest, WithoutItOneDatagramEndsTheProcess) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(live_without_the_filter(testing::test_domain()), ::testing::KilledBySignal(SIGABRT), "");
}

TEST(ReceiveFilter, DropsTheDatagramAndSaysSoWhileSamplesFlow) {
  Node writing{local("writing"), standard_profiles()};
  Node reading{local("reading"), standard_profiles()};
  std::atomic<std::uint64_t> newest{0};
  auto writer = writing.writer<stage::AxisState>("cell/test/axis/state", "realtime");
  const auto reader = reading.reader<stage::AxisState>(
      "cell/test/axis/state", "realtime", [&](const auto& state) { newest = state.at().cycle(); });
  stage::AxisState state;
  const auto flows = [&] {
    const std::uint64_t from = state.at().cycle() + 1;
    return eventually([&] {
      state.at().cycle(state.at().cycle() + 1);
      writer.write(state);
      return newest >= from;
    });
  };
  ASSERT_TRUE(flows());
  const Sender sender{testing::test_domain()};
  for (int i = 0; i < 1000; ++i) sender.send(deadly());
  EXPECT_TRUE(flows());
  std::string told;
  EXPECT_TRUE(eventually([&] {
    for (const auto& alarm : reading.take_alarms()) told += alarm.text;
    return !told.empty();
  }));
  EXPECT_THAT(told, HasSubstr("with a kind of submessage that is not expected here"));
  EXPECT_THAT(told, HasSubstr("the last one from 127.0.0.1:"));
  sender.send(deadly());
  EXPECT_TRUE(reading.take_alarms().empty()) << "one in ten seconds is enough";
}

std::vector<std::uint8_t> little_endian(std::initializer_list<std::uint32_t> words) {
  std::vector<std::uint8_t> octets;
  for (const std::uint32_t word : words)
    for (const unsigned shift : {0U, 8U, 16U, 24U})
      octets.push_back(static_cast<std::uint8_t>(word >> shift));
  return octets;
}

/// What a participant says of itself; nobody listens at its ports.
std::vector<std::byte> announcement() {
  std::vector<std::uint8_t> guid(16, invar::testing::RtpsBuilder::prefix_octet);
  std::copy_n(std::array<std::uint8_t, 4>{0, 0, 1, 0xc1}.begin(), 4, guid.begin() + 12);
  auto locator = little_endian({1, 9, 0, 0, 0});
  locator.insert(locator.end(), {127, 0, 0, 1});
  return invar::testing::RtpsBuilder{}
      .data(4, 0x000100c2, 1)
      .fill(1)
      .u8(3)
      .u16(0)
      .parameter(0x0015, {2, 3, 0, 0})
      .parameter(0x0016, {1, 15, 0, 0})
      .parameter(0x0050, guid)
      .parameter(0x0032, locator)
      .parameter(0x0031, locator)
      .parameter(0x0002, little_endian({100, 0}))
      .parameter(0x0058, little_endian({0}))
      .sentinel()
      .bytes();
}

/// A peer that answers the first message of each new participant at once, and says nothing else.
class QuickPeer {
 public:
  explicit QuickPeer(std::uint32_t domain) : sender_{domain} {
    const int on = 1;
    setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain));
    inet_pton(AF_INET, "239.255.0.1", &own.sin_addr);
    bound_ = bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0;
    ip_mreq group{own.sin_addr, {htonl(INADDR_LOOPBACK)}};
    bound_ = bound_ && setsockopt(socket_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0;
    const timeval patience{0, 100'000};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    thread_ = std::jthread{[this](const std::stop_token& stop) { run(stop); }};
  }
  ~QuickPeer() {
    thread_.request_stop();
    thread_.join();
    close(socket_);
  }
  QuickPeer(const QuickPeer&) = delete;
  QuickPeer& operator=(const QuickPeer&) = delete;
  [[nodiscard]] bool is_bound() const { return bound_; }

 private:
  void run(const std::stop_token& stop) {
    const auto answer = announcement();
    std::set<std::string> known{
        std::string(12, static_cast<char>(invar::testing::RtpsBuilder::prefix_octet))};
    std::array<char, 65'536> message;
    while (!stop.stop_requested()) {
      const auto size = recv(socket_, message.data(), message.size(), 0);
      if (size > 20 && known.insert({message.data() + 8, 12}).second) sender_.send(answer);
    }
  }

  Sender sender_;
  int socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bool bound_ = false;
  std::jthread thread_;
};

TEST(ReceiveFilter, KeepsTheAnswerOfAPeerThatIsQuickerThanTheParticipantIsMade) {
  const QuickPeer peer{testing::test_domain()};
  ASSERT_TRUE(peer.is_bound());
  int heard = 0;
  constexpr int rounds = 20;
  for (int round = 0; round < rounds; ++round) {
    const Node late{local("late"), standard_profiles()};
    if (eventually([&] { return late.snapshot().participants.size() == 2; }, 0.5)) ++heard;
  }
  EXPECT_GE(heard, rounds - 1);  // the peer says it once: a busy host may lose a datagram
}

}  // namespace
}  // namespace invar::dds
