// Sends broken RTPS messages to every participant of a DDS domain, from a participant that they know, and under their own names.
// Arguments: domain, address of this host (or "all"), messages, seed, and optionally messages a second. Ends with a line of what
// it sent.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "tests/support/rtps_mutator.hpp"
#include "tests/support/rtps_tap.hpp"

namespace {

using namespace std::chrono_literals;

sockaddr_in destination(const char* address, std::uint16_t port) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  inet_pton(AF_INET, address, &to.sin_addr);
  return to;
}

}  // namespace

int main(int count, char** words) {
  using namespace invar::testing;
  if (count < 5) return 2;
  const auto domain = static_cast<std::uint32_t>(std::atol(words[1]));
  const std::string address = words[2];
  const long messages = std::atol(words[3]);
  const auto seed = static_cast<std::uint32_t>(std::atol(words[4]));
  const double rate = count > 5 ? std::atof(words[5]) : 1e9;

  RtpsTap tap{domain, address == "all" ? "" : address, 5, 1400};
  for (int i = 0; i < 30; ++i) {
    std::this_thread::sleep_for(100ms);
    tap.join();
    if (i % 5 == 0) tap.write();
  }
  const RtpsCorpus corpus = tap.messages();
  tap.guard();  // its own messages would end it
  const char* host = address == "all" ? "127.0.0.1" : address.c_str();
  std::vector<sockaddr_in> to;
  for (const std::uint16_t port : tap.ports()) to.push_back(destination(host, port));
  to.push_back(destination("239.255.0.1", static_cast<std::uint16_t>(7400 + 250 * domain)));
  std::printf("seed %u: %zu messages heard, %zu ports\n", seed, corpus.size(), to.size() - 1);
  if (corpus.empty() || to.size() < 3) return std::puts("nobody there"), 1;

  const int out = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  in_addr interface {};
  inet_pton(AF_INET, host, &interface);
  setsockopt(out, IPPROTO_IP, IP_MULTICAST_IF, &interface, sizeof interface);
  RtpsMutator mutator{corpus, seed};
  const auto begin = std::chrono::steady_clock::now();
  long sent = 0;
  for (long i = 0; i < messages; ++i) {
    const auto& message = mutator.next();
    const sockaddr_in& where = to[static_cast<std::size_t>(i) % to.size()];
    sent += sendto(out, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&where),
                   sizeof where) >= 0;
    if (i % 256 == 0)
      std::this_thread::sleep_until(begin + std::chrono::duration<double>(static_cast<double>(i) / rate));
  }
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  std::printf("%ld broken messages sent in %.1f s\n", sent, spent.count());
  close(out);
  return 0;
}
