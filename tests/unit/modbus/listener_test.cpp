// The simulated device's sockets: requests cut anywhere, several at once, and bytes that are no Modbus.
#include "core/modbus/listener.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/base/fault.hpp"

namespace invar::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

class Connection {
 public:
  explicit Connection(std::uint16_t port) : socket_{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)} {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    is_open = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    const timeval watchdog{60, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &watchdog, sizeof watchdog);
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void send(const Bytes& bytes) const { (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// The next `count` bytes; fewer when the connection ends.
  [[nodiscard]] Bytes receive(std::size_t count) const {
    Bytes bytes(count);
    const ssize_t size = ::recv(socket_, bytes.data(), count, MSG_WAITALL);
    bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return bytes;
  }

  bool is_open = false;

 private:
  int socket_;
};

/// Answers every request with itself.
struct Echo {
  Listener listener{"127.0.0.1", 0,
                    [](std::span<const std::uint8_t> request) {
                      Verdict verdict;
                      std::copy(request.begin(), request.end(), verdict.reply.begin());
                      verdict.size = request.size();
                      return verdict;
                    },
                    [] {}};
};

const Bytes request{0, 7, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};

TEST(Listener, PutsARequestTogetherThatComesByteByByte) {
  Echo echo;
  const Connection master{echo.listener.port()};
  for (const std::uint8_t byte : request) master.send({byte});
  EXPECT_EQ(master.receive(request.size()), request);
}

TEST(Listener, AnswersRequestsThatComeTogetherOneByOne) {
  Echo echo;
  const Connection master{echo.listener.port()};
  Bytes both = request;
  both.insert(both.end(), request.begin(), request.end());
  Bytes more = both;
  more.resize(both.size() + 5);  // and the beginning of a third
  master.send(more);
  EXPECT_EQ(master.receive(both.size()), both);
}

TEST(Listener, LetsGoOfAMasterThatDoesNotSpeakModbusAndServesTheNext) {
  Echo echo;
  for (const Bytes& nonsense : {Bytes{'G', 'E', 'T', ' ', '/', '\r', '\n'}, Bytes{0, 1, 0, 0, 1, 0, 1, 3},
                                Bytes{0, 1, 0, 0, 0, 1, 1}}) {
    const Connection stranger{echo.listener.port()};
    stranger.send(nonsense);
    EXPECT_TRUE(stranger.receive(1).empty());
  }
  const Connection master{echo.listener.port()};
  master.send(request);
  EXPECT_EQ(master.receive(request.size()), request);
}

TEST(Listener, RefusesAndComesBackOnItsPort) {
  Echo echo;
  const Connection before{echo.listener.port()};
  before.send(request);
  EXPECT_EQ(before.receive(request.size()), request);
  echo.listener.refuse(true);
  EXPECT_TRUE(before.receive(1).empty());
  EXPECT_FALSE(Connection{echo.listener.port()}.is_open);
  echo.listener.refuse(false);
  const Connection after{echo.listener.port()};
  after.send(request);
  EXPECT_EQ(after.receive(request.size()), request);
}

TEST(Listener, SaysWhichAddressItCannotHave) {
  Echo echo;
  try {
    const Listener second{"127.0.0.1", echo.listener.port(), {}, {}};
    FAIL() << "both listen at one port";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string{error.what()},
              "modbus server 127.0.0.1:" + std::to_string(echo.listener.port()) +
                  ": Address already in use; choose another port, or 0 for a free one");
  }
}

}  // namespace
}  // namespace invar::modbus
