// One of two processes of one PC: `one_pc_peer NAME PEER SECONDS [PRIORITY]`, longer on a busy machine. Each writes a loop's state at 500 Hz and a slow
// state, and reads those of the other. At the end it prints how many of the peer's samples came, the share of a core that its
// busiest thread took, how many segments of shared memory it has opened (two are its own), and what was told. `one_pc_peer --foreign`
// is a program that is not of Invar: it sends announcements by shared memory to every port that it finds there.
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>

#include "core/base/clock.hpp"
#include "core/dds/shared_memory_calls.hpp"
#include "idl/types.hpp"
#include "tests/unit/dds/domain.hpp"

namespace invar {
namespace {

/// User and system time of a thread [s].
double seconds_of(const std::filesystem::path& task) {
  std::ifstream file{task / "stat"};
  std::string text{std::istreambuf_iterator<char>{file}, {}};
  const auto end = text.rfind(") ");
  if (end == std::string::npos) return 0.0;
  std::istringstream words{text.substr(end + 2)};
  std::string skipped;
  for (int i = 0; i < 11; ++i) words >> skipped;  // state is field 3, user time field 14
  double user = 0.0, system = 0.0;
  words >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

std::map<std::string, double> seconds_of_threads() {
  std::map<std::string, double> out;
  for (const auto& task : std::filesystem::directory_iterator{"/proc/self/task"})
    out[task.path().filename().string()] = seconds_of(task.path());
  return out;
}

/// Names of the segments that are mapped here.
std::size_t segments() {
  std::ifstream maps{"/proc/self/maps"};
  std::set<std::string> names;
  for (std::string line; std::getline(maps, line);) {
    const auto at = line.find("/dev/shm/fastrtps_");
    if (at != std::string::npos && line.find("_port", at) == std::string::npos) names.insert(line.substr(at));
  }
  return names.size();
}

int intrude() {
  namespace fdds = eprosima::fastdds::dds;
  using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
  fdds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::make_shared<SharedMemTransportDescriptor>());
  const std::string prefix = "fastrtps_port";
  for (const auto& entry : std::filesystem::directory_iterator{"/dev/shm"}) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix) || name.find('_', prefix.size()) != std::string::npos) continue;
    eprosima::fastrtps::rtps::Locator_t port{
        LOCATOR_KIND_SHM, static_cast<std::uint32_t>(std::stoul(name.substr(prefix.size())))};
    port.address[0] = 'U';
    qos.wire_protocol().builtin.initialPeersList.push_back(port);
  }
  std::cout << "foreign: " << qos.wire_protocol().builtin.initialPeersList.size() << " ports" << std::endl;
  auto* factory = fdds::DomainParticipantFactory::get_instance();
  auto* participant = factory->create_participant(8, qos);
  if (participant == nullptr) return 1;
  std::this_thread::sleep_for(std::chrono::milliseconds{2500});
  factory->delete_participant(participant);
  return 0;
}

int take_part(int argc, char** argv) {
  if (argc == 2 && std::string{argv[1]} == "--foreign") return intrude();
  if (argc < 4) return 2;
  const std::string name = argv[1], peer = argv[2];
  const double seconds = std::stod(argv[3]);
  dds::NodeOptions options;
  options.cell = "one-pc";
  options.process = name;
  options.domain = 8;
  options.addresses = {"127.0.0.1"};
  if (argc > 4) options.realtime_priority = std::stoi(argv[4]);
  if (!dds::shared_memory_calls_are_ours()) std::cout << "calls: not ours\n";
  dds::Node node{options, dds::standard_profiles()};
  auto loop = node.writer<stage::AxisState>("cell/one-pc/" + name + "/state", "realtime");
  auto slow = node.writer<thermal::NodeTemperature>("cell/one-pc/" + name + "/node", "state");
  std::atomic<std::uint64_t> first{0}, last{0}, came{0}, slow_came{0};
  std::atomic<std::int64_t> newest_ns{0};
  const auto loop_reader =
      node.reader<stage::AxisState>("cell/one-pc/" + peer + "/state", "realtime", [&](const auto& s) {
        if (first == 0) first = s.at().cycle();
        last = s.at().cycle();
        ++came;
        newest_ns = monotonic_now().ns;
      });
  const auto slow_reader = node.reader<thermal::NodeTemperature>("cell/one-pc/" + peer + "/node", "state",
                                                                 [&](const auto&) { ++slow_came; });
  stage::AxisState sample;
  thermal::NodeTemperature temperature;
  const auto begin = std::chrono::steady_clock::now();
  std::map<std::string, double> before;
  double measured = 0.0;
  std::optional<double> enough_at;
  for (std::uint64_t cycle = 1;; ++cycle) {
    const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    // On a busy machine longer, so that there is something to count; the peer needs some more of ours.
    const bool enough = came >= 300 && slow_came >= 6;
    if (enough && !enough_at) enough_at = now;
    if ((now > seconds && enough_at && now > *enough_at + 1.0) || now > 45.0) break;
    if (before.empty() && now > 0.4 * seconds) {
      before = seconds_of_threads();
      measured = now;
    }
    sample.at().cycle(cycle);
    loop.write(sample);
    if (cycle % 50 == 0) {
      temperature.at().cycle(cycle);
      slow.write(temperature);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  const std::size_t opened = segments();
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  double busiest = 0.0;
  for (const auto& [task, spent] : seconds_of_threads())
    busiest = std::max(busiest, (spent - before[task]) / (elapsed - measured));
  std::cout << "came " << came << " of " << (came == 0 ? 0 : last - first + 1) << ", slow " << slow_came
            << ", busiest " << busiest << ", segments " << opened << ", newest "
            << 1e-9 * static_cast<double>(monotonic_now().ns - newest_ns) << " s ago" << std::endl;
  for (const auto& alarm : node.take_alarms())
    std::cout << "told " << alarm.topic << ": " << alarm.text << std::endl;
  return 0;
}

}  // namespace
}  // namespace invar

int main(int argc, char** argv) { return invar::take_part(argc, argv); }
