// Bench: the cost of a secured cell. Two processes over UDP on the loopback, or many that find one another.
//   bench_secured latency KEYS SAMPLES [PROFILE HZ]
//   bench_secured discovery KEYS PROCESSES
// KEYS is the folder that `invar keys` made for a cell `bench` of supervisors p0, p1 and so on; `-` runs unsecured. The samples
// have PROFILE and HZ, or `realtime` and 1000.
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/base/clock.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/node.hpp"
#include "core/dds/profile.hpp"
#include "idl/lifecycle.h"

namespace {

using namespace invar;

dds::NodeOptions options_of(const std::string& keys, int number) {
  dds::NodeOptions options;
  options.cell = "bench";
  options.process = "p" + std::to_string(number);
  options.domain = 88;
  options.addresses = {"127.0.0.1"};
  options.shared_memory = false;
  if (keys != "-") options.identity = dds::Identity{{keys}, options.process, false};
  return options;
}

std::string topic() { return dds::ServiceTopics{"bench"}.process_status; }

double cpu_seconds() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

/// False: not so many came within a minute.
bool hear(const std::string& keys, std::size_t samples, const std::string& profile) {
  dds::Node node{options_of(keys, 1), dds::standard_profiles()};
  std::mutex mutex;
  std::vector<double> late;
  std::uint64_t first = 0, last = 0;  // numbers of samples
  const auto reader = node.reader<lifecycle::ProcessStatus>(topic(), profile, [&](const auto& status) {
    const double us = 1e-3 * static_cast<double>(monotonic_now().ns - status.at().time_ns());
    const std::lock_guard lock{mutex};
    if (late.empty()) first = status.cycles();
    last = status.cycles();
    late.push_back(us);
  });
  const auto count = [&] {
    const std::lock_guard lock{mutex};
    return late.size();
  };
  const auto began = std::chrono::steady_clock::now();
  const auto wait_for = [&](std::size_t number) {
    while (count() < number && std::chrono::steady_clock::now() - began < std::chrono::seconds{60})
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    return count() >= number;
  };
  if (!wait_for(1)) return false;
  std::this_thread::sleep_for(std::chrono::seconds{1});  // until the last end has found the other
  {
    const std::lock_guard lock{mutex};
    late.clear();
  }
  const double before = cpu_seconds();
  if (!wait_for(samples)) return false;
  const double cpu = cpu_seconds() - before;
  const std::lock_guard lock{mutex};
  std::sort(late.begin(), late.end());
  const auto at = [&](double part) {
    return late[static_cast<std::size_t>(part * static_cast<double>(late.size() - 1))];
  };
  std::cout << "samples " << late.size() << "  p50 " << at(0.5) << " us  p99 " << at(0.99) << " us  max "
            << late.back() << " us  lost " << last - first + 1 - late.size() << "  reader " << cpu
            << " s of CPU" << std::endl;
  return true;
}

int latency(const std::string& keys, std::size_t samples, const std::string& profile, int rate) {
  const pid_t child = fork();
  if (child == 0) {
    _exit(hear(keys, samples, profile) ? 0 : 1);
  }
  dds::Node node{options_of(keys, 0), dds::standard_profiles()};
  auto writer = node.writer<lifecycle::ProcessStatus>(topic(), profile);
  const std::chrono::nanoseconds period{1'000'000'000 / rate};
  lifecycle::ProcessStatus status;
  status.process_name("p0");
  int end = 0;
  for (auto due = std::chrono::steady_clock::now(); waitpid(child, &end, WNOHANG) == 0;) {
    std::this_thread::sleep_until(due += period);
    if (writer.connection().matched() == 0) continue;
    status.cycles(status.cycles() + 1);
    status.at().time_ns(monotonic_now().ns);
    writer.write(status);
  }
  return end == 0 ? 0 : 1;
}

/// Says in how many seconds it heard each of the others; whether it did goes into `report`.
void find(const std::string& keys, int number, int processes, int report) {
  constexpr auto longest = std::chrono::seconds{30};
  const auto begin = std::chrono::steady_clock::now();
  dds::Node node{options_of(keys, number), dds::standard_profiles()};
  std::mutex mutex;
  std::set<std::string> heard;
  const auto reader = node.reader<lifecycle::ProcessStatus>(topic(), "state", [&](const auto& status) {
    const std::lock_guard lock{mutex};
    heard.insert(status.process_name().c_str());
  });
  auto writer = node.writer<lifecycle::ProcessStatus>(topic(), "state");
  lifecycle::ProcessStatus status;
  status.process_id(static_cast<std::uint32_t>(number) + 1);
  status.process_name(node.options().process);
  writer.write(status);
  const auto count = [&] {
    const std::lock_guard lock{mutex};
    return heard.size();
  };
  while (count() < static_cast<std::size_t>(processes) && std::chrono::steady_clock::now() - begin < longest)
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::cout << "p" + std::to_string(number) + " heard " + std::to_string(count()) + " of " +
                   std::to_string(processes) + " in " + std::to_string(seconds) + " s\n"
            << std::flush;
  const char all = count() == static_cast<std::size_t>(processes) ? 1 : 0;
  if (write(report, &all, 1) != 1) return;
  pause();  // nobody leaves before all were heard
}

/// 0: each heard each.
int discovery(const std::string& keys, int processes) {
  std::array<int, 2> report{};
  if (pipe(report.data()) != 0) return 2;
  std::vector<pid_t> children;
  for (int number = 0; number < processes; ++number) {
    children.push_back(fork());
    if (children.back() != 0) continue;
    find(keys, number, processes, report[1]);
    _exit(0);
  }
  close(report[1]);
  int complete = 0;
  char all = 0;
  for (int i = 0; i < processes && read(report[0], &all, 1) == 1; ++i) complete += all;
  for (const pid_t child : children) kill(child, SIGKILL);
  while (wait(nullptr) > 0) {
  }
  return complete == processes ? 0 : 1;
}

}  // namespace

int main(int count, char** words) {
  if (count != 4 && count != 6) return 2;
  const std::string_view what = words[1];
  const int number = std::atoi(words[3]), rate = count == 6 ? std::atoi(words[5]) : 1000;
  if (rate < 1) return 2;
  return what == "latency"
             ? latency(words[2], static_cast<std::size_t>(number), count == 6 ? words[4] : "realtime", rate)
             : discovery(words[2], number);
}
