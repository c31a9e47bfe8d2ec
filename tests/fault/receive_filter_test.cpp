// The datagram that ends a program of Fast DDS 2.9.1, sent to one without the filter and to a node of ours.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

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

}  // namespace
}  // namespace invar::dds
