// Modbus polls per second: our bus against bare libmodbus calls for the same registers and the same server.
//
// usage: bench_modbus [ROUNDS]     (default 40; each round measures both for 50 ms in turn)
//
// The server is a plain libmodbus loop, one thread a connection, on loopback. Bare: one modbus_read_* call for each
// request of the plan, the raw words left as they are. Ours: Bus::exchange, which decodes every register, stamps it
// and keeps the counters. Clients share one core and servers another: left to the scheduler, turns of either differ by a
// factor of three. The table shows medians over the rounds, the quartiles of the ratio within a round, and the machine.
#include <modbus.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/base/clock.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/grouping.hpp"

namespace {

using namespace invar;          // NOLINT: a program, not a header
using namespace invar::modbus;  // NOLINT

/// Keeps the calling thread on this core, where there is one.
void keep_on_core(std::size_t core) {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(core, &one);
  pthread_setaffinity_np(pthread_self(), sizeof one, &one);
}

/// Serves two connections with 2000 of everything until both are closed.
class BareServer {
 public:
  BareServer() {
    listening_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    if (::bind(listening_, generic, size) != 0 || ::listen(listening_, 4) != 0 ||
        ::getsockname(listening_, generic, &size) != 0)
      throw std::runtime_error{"no server"};
    port_ = ntohs(address.sin_port);
    for (int i = 0; i < 2; ++i)
      threads_.emplace_back([this] {
        keep_on_core(1);
        serve();
      });
  }
  ~BareServer() {
    for (auto& thread : threads_) thread.join();
    ::close(listening_);
  }
  BareServer(const BareServer&) = delete;
  BareServer& operator=(const BareServer&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void serve() const {
    modbus_t* context = modbus_new_tcp("127.0.0.1", port_);
    modbus_mapping_t* mapping = modbus_mapping_new(2000, 2000, 2000, 2000);
    int socket = listening_;
    modbus_tcp_accept(context, &socket);
    std::vector<std::uint8_t> request(MODBUS_TCP_MAX_ADU_LENGTH);
    for (;;) {
      const int length = modbus_receive(context, request.data());
      if (length < 0 || modbus_reply(context, request.data(), length, mapping) < 0) break;
    }
    modbus_mapping_free(mapping);
    modbus_close(context);
    modbus_free(context);
  }

  int listening_ = -1;
  std::uint16_t port_ = 0;
  std::vector<std::thread> threads_;
};

class BareClient {
 public:
  BareClient(std::uint16_t port, const RegisterMap& map)
      : context_{modbus_new_tcp("127.0.0.1", port)}, plan_{plan_reads(map)} {
    if (modbus_connect(context_) != 0) throw std::runtime_error{"no connection"};
  }
  ~BareClient() {
    modbus_close(context_);
    modbus_free(context_);
  }
  BareClient(const BareClient&) = delete;
  BareClient& operator=(const BareClient&) = delete;

  bool poll() {
    for (const auto& request : plan_) {
      int got = 0;
      switch (request.kind) {
        case Kind::coil:
          got = modbus_read_bits(context_, request.address, request.count, bits_.data());
          break;
        case Kind::discrete:
          got = modbus_read_input_bits(context_, request.address, request.count, bits_.data());
          break;
        case Kind::input:
          got = modbus_read_input_registers(context_, request.address, request.count, words_.data());
          break;
        case Kind::holding:
          got = modbus_read_registers(context_, request.address, request.count, words_.data());
          break;
      }
      if (got != request.count) return false;
    }
    return true;
  }

 private:
  modbus_t* context_;
  std::vector<ReadRequest> plan_;
  std::vector<std::uint8_t> bits_ = std::vector<std::uint8_t>(2000);
  std::vector<std::uint16_t> words_ = std::vector<std::uint16_t>(125);
};

template <class Poll>
double polls_per_second(const Poll& poll) {
  const Instant begin = monotonic_now();
  const Instant end = begin + Duration::milliseconds(50);
  Instant now = begin;
  std::int64_t count = 0;
  for (; now < end; now = monotonic_now()) {
    if (!poll(now)) throw std::runtime_error{"a poll failed"};
    ++count;
  }
  return static_cast<double>(count) / (now - begin).in_seconds();
}

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

void compare(const std::string& name, const RegisterMap& map, int rounds) {
  BareServer server;
  BareClient bare{server.port(), map};
  Bus bus{{.port = server.port(), .answer_timeout = Duration::seconds(10)}};
  bus.add(map);
  const auto poll_bare = [&](Instant) { return bare.poll(); };
  const auto poll_ours = [&](Instant now) { return bus.exchange(now); };
  std::vector<double> bare_rates;
  std::vector<double> our_rates;
  std::vector<double> ratios;
  for (int i = -2; i < rounds; ++i) {  // two rounds to warm up; who goes first alternates
    double first = 0.0;
    double second = 0.0;
    if (i % 2 == 0) {
      first = polls_per_second(poll_bare);
      second = polls_per_second(poll_ours);
    } else {
      second = polls_per_second(poll_ours);
      first = polls_per_second(poll_bare);
    }
    if (i < 0) continue;
    bare_rates.push_back(first);
    our_rates.push_back(second);
    ratios.push_back(second / first);
  }
  std::printf("| %-28s | %8zu | %9zu | %9.0f | %9.0f | %5.3f | %5.3f to %5.3f |\n", name.c_str(),
              plan_reads(map).size(), map.registers.size(), quantile(bare_rates, 0.5),
              quantile(our_rates, 0.5), quantile(ratios, 0.5), quantile(ratios, 0.25),
              quantile(ratios, 0.75));
}

RegisterMap block(unsigned registers) {
  std::string text = "invar_modbus_map: 1\ndevice: block\nregisters:\n";
  for (unsigned i = 0; i < registers; ++i)
    text += "  r" + std::to_string(i) + ": {address: " + std::to_string(i) +
            ", kind: holding, type: uint16, scale: 0.1, access: read}\n";
  return parse_map(text, "block");
}

}  // namespace

int main(int argc, char** argv) {
  keep_on_core(0);
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 40;
  if (rounds < 1) {
    std::fprintf(stderr, "usage: bench_modbus [ROUNDS]\n");
    return 2;
  }
  utsname system{};
  uname(&system);
  std::printf(
      "Modbus polls per second on loopback; %ld CPUs, Linux %s, %d rounds of 2 x 50 ms, interleaved\n\n",
      sysconf(_SC_NPROCESSORS_ONLN), system.release, rounds);
  std::printf(
      "| registers                    | requests | registers | bare 1/s  | ours 1/s  | ratio | quartiles     "
      " |\n");
  std::printf(
      "| ---                          | ---      | ---       | ---       | ---       | ---   | ---           "
      " |\n");
  compare("10 holding registers", block(10), rounds);
  compare("125 holding registers", block(125), rounds);
  compare("deployment/maps/heater.yaml", load_map(INVAR_SOURCE_DIR "/deployment/maps/heater.yaml"), rounds);
  compare("deployment/maps/pneumatic", load_map(INVAR_SOURCE_DIR "/deployment/maps/pneumatic.yaml"), rounds);
  return 0;
}
