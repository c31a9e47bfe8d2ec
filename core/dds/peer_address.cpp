#include "core/dds/peer_address.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

namespace invar::dds {

namespace {

bool is_abandoned(const PeerAddress& address, Duration patience) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(address.port);
  if (address.port == 0 || inet_pton(AF_INET, address.host.c_str(), &to.sin_addr) != 1) return false;
  const int end = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (end < 0) return false;
  bool refused = false;
  // "RTPS", version 2.1, no vendor, no participant
  constexpr std::uint8_t header[20] = {'R', 'T', 'P', 'S', 2, 1};
  if (connect(end, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
      send(end, header, sizeof header, MSG_DONTWAIT | MSG_NOSIGNAL) == sizeof header) {
    pollfd waiting{end, 0, 0};  // errors are always reported
    const timespec time{patience.ns / 1'000'000'000, patience.ns % 1'000'000'000};
    if (ppoll(&waiting, 1, &time, nullptr) > 0) {
      int error = 0;
      socklen_t size = sizeof error;
      refused = getsockopt(end, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == ECONNREFUSED;
    }
  }
  close(end);
  return refused;
}

}  // namespace

bool are_abandoned(const std::vector<PeerAddress>& addresses, Duration patience) {
  return !addresses.empty() && std::all_of(addresses.begin(), addresses.end(), [patience](const auto& one) {
    return is_abandoned(one, patience);
  });
}

}  // namespace invar::dds
