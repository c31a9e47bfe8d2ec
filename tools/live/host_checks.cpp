#include "tools/live/host_checks.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include "core/dds/memory_plan.hpp"
#include "core/dds/node.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;
using Level = Finding::Level;

std::optional<std::string> first_line(const fs::path& file) {
  std::ifstream in{file};
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  return line;
}

bool has_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders{path != nullptr ? path : "/usr/bin:/bin"};
  for (std::string folder; std::getline(folders, folder, ':');)
    if (access((fs::path{folder} / name).c_str(), X_OK) == 0) return true;
  return false;
}

Finding program(const std::string& name, const std::string& package, const std::string& need, Level missing) {
  if (has_program(name)) return {Level::good, name, "installed", ""};
  return {missing, name, "not installed; " + need, "apt install " + package};
}

/// Tried on a thread of its own, which ends at once.
Finding real_time_permission() {
  int error = 0;
  std::thread{[&error] {
    sched_param wanted{};
    wanted.sched_priority = 80;
    error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
  }}.join();
  if (error == 0) return {Level::good, "real-time scheduling", "SCHED_FIFO 80 is granted", ""};
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  return {Level::bad, "real-time scheduling",
          "SCHED_FIFO 80 is refused (rtprio limit " + std::to_string(limit.rlim_cur) + ")",
          "add `<user> - rtprio 95` to /etc/security/limits.conf and log in again"};
}

Finding locked_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  if (limit.rlim_cur == RLIM_INFINITY || geteuid() == 0)
    return {Level::good, "locked memory", geteuid() == 0 ? "unlimited (root)" : "unlimited", ""};
  return {Level::bad, "locked memory",
          "at most " + number_text(static_cast<double>(limit.rlim_cur) / 1e6) + " MB",
          "add `<user> - memlock unlimited` to /etc/security/limits.conf and log in again"};
}

Finding kernel() {
  utsname system{};
  uname(&system);
  const std::string version = system.version;
  const std::string text = std::string{system.release};
  if (version.find("PREEMPT_RT") != std::string::npos || first_line("/sys/kernel/realtime") == "1")
    return {Level::good, "kernel", text + ", PREEMPT_RT", ""};
  return {Level::note, "kernel", text + ", not PREEMPT_RT: the loop is late by milliseconds now and then",
          "apt install linux-image-rt-amd64, where that matters; `invar latency-test` shows"};
}

Finding throttling() {
  const auto runtime = first_line("/proc/sys/kernel/sched_rt_runtime_us");
  if (!runtime || *runtime == "-1") return {Level::good, "real-time throttling", "off", ""};
  return {Level::note, "real-time throttling",
          "real-time threads get at most " + *runtime + " us of each period",
          "nothing, as long as no loop takes nearly all of its core"};
}

Finding shared_memory_room() {
  struct statvfs room {};
  if (statvfs("/dev/shm", &room) != 0)
    return {Level::bad, "/dev/shm", "is not there: no shared memory between processes",
            "mount -t tmpfs tmpfs /dev/shm, or `shared_memory: false` in the cell file"};
  const double free = static_cast<double>(room.f_bavail) * static_cast<double>(room.f_frsize);
  const double process =
      static_cast<double>(dds::wanted_memory(dds::Traffic::general, dds::NodeOptions{}.segment_size).total() +
                          dds::wanted_memory(dds::Traffic::realtime, 0).total());
  const std::string text = number_text(free / 1e6) + " MB free";
  if (free > 10.0 * process) return {Level::good, "/dev/shm", text, ""};
  return {Level::bad, "/dev/shm",
          text + ": room for " + std::to_string(static_cast<int>(free / process)) +
              " processes, others take less or use UDP",
          "mount -o remount,size=1G /dev/shm; in a container --shm-size"};
}

/// A living participant holds a lock on the file beside its segment.
Finding shared_memory_leftovers() {
  std::set<ino_t> locked;
  std::ifstream locks{"/proc/locks"};
  for (std::string line; std::getline(locks, line);) {
    const auto first = line.find(':', line.find(':') + 1);  // "1: FLOCK ADVISORY WRITE 123 00:19:4711 0 EOF"
    const auto second = line.find(':', first + 1);
    if (second != std::string::npos) locked.insert(std::strtoul(line.c_str() + second + 1, nullptr, 10));
  }
  std::size_t dead = 0;
  double bytes = 0.0;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{"/dev/shm", error}) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("fastrtps_") || !name.ends_with("_el") || name.find("port") != std::string::npos)
      continue;
    struct stat about {};
    if (stat(entry.path().c_str(), &about) != 0 || locked.contains(about.st_ino)) continue;
    ++dead;
    const std::string segment = entry.path().string().substr(0, entry.path().string().size() - 3);
    if (stat(segment.c_str(), &about) == 0) bytes += static_cast<double>(about.st_blocks) * 512.0;
  }
  if (dead == 0) return {Level::good, "shared memory of dead processes", "none", ""};
  return {bytes > 100e6 ? Level::bad : Level::note, "shared memory of dead processes",
          std::to_string(dead) + " segments, " + number_text(bytes / 1e6) + " MB", "fastdds shm clean"};
}

std::vector<Finding> interfaces() {
  std::vector<Finding> findings;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return findings;
  std::set<std::string> seen;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET ||
        (entry->ifa_flags & IFF_UP) == 0)
      continue;
    if (!seen.insert(entry->ifa_name).second) continue;
    char address[INET_ADDRSTRLEN] = "?";
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr, address,
              sizeof address);
    const std::string what = std::string{"interface "} + entry->ifa_name;
    const bool multicast = (entry->ifa_flags & IFF_MULTICAST) != 0;
    if (multicast)
      findings.push_back({Level::good, what, std::string{address} + ", multicast on", ""});
    else
      findings.push_back(
          {(entry->ifa_flags & IFF_LOOPBACK) != 0 ? Level::note : Level::bad, what,
           std::string{address} + ", multicast off: " +
               ((entry->ifa_flags & IFF_LOOPBACK) != 0 ? "Cyclone DDS finds nobody over it"
                                                       : "PCs do not find one another over it"),
           std::string{"ip link set "} + entry->ifa_name + " multicast on"});
  }
  freeifaddrs(list);
  return findings;
}

Finding receive_buffers() {
  const auto text = first_line("/proc/sys/net/core/rmem_max");
  const double most = text ? std::strtod(text->c_str(), nullptr) : 0.0;
  const std::string state = "at most " + number_text(most / 1e6) + " MB a socket";
  if (most >= 8 << 20) return {Level::good, "network receive buffers", state, ""};
  return {Level::note, "network receive buffers",
          state + ": bursts of images and calibration data between PCs lose samples",
          "sysctl -w net.core.rmem_max=8388608 net.core.wmem_max=8388608"};
}

Finding clock_source() {
  const auto source = first_line("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (!source) return {Level::note, "clock source", "unknown", "look at dmesg"};
  if (*source == "hpet" || *source == "acpi_pm" || *source == "jiffies" || *source == "pit")
    return {Level::bad, "clock source", *source + ": reading the time takes microseconds",
            "boot with clocksource=tsc tsc=reliable, if the CPU's TSC is stable"};
  return {Level::good, "clock source", *source, ""};
}

Finding governor() {
  std::map<std::string, int> counts;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{"/sys/devices/system/cpu", error})
    if (const auto name = first_line(entry.path() / "cpufreq/scaling_governor")) ++counts[*name];
  if (counts.empty()) return {Level::good, "CPU governor", "none: the clock is not ours to set", ""};
  std::string text;
  for (const auto& [name, count] : counts)
    text += (text.empty() ? "" : ", ") + name + " on " + std::to_string(count);
  if (counts.size() == 1 && counts.contains("performance")) return {Level::good, "CPU governor", text, ""};
  return {Level::bad, "CPU governor", text + ": cores that slow down wake late",
          "cpupower frequency-set -g performance"};
}

Finding load() {
  double average[1] = {0.0};
  getloadavg(average, 1);
  const unsigned cores = std::thread::hardware_concurrency();
  const std::string text = number_text(average[0]) + " on " + std::to_string(cores) + " cores";
  if (average[0] < 0.8 * cores) return {Level::good, "load", text, ""};
  return {Level::note, "load", text + ": loops without real-time priority will be late",
          "stop what need not run, or use more cores"};
}

Finding time_sync() {
  timex state{};
  if (adjtimex(&state) != TIME_ERROR) return {Level::good, "time synchronisation", "in step", ""};
  return {Level::note, "time synchronisation", "not in step: stamps of several PCs cannot be compared",
          "apt install chrony, or linuxptp for microseconds"};
}

}  // namespace

std::vector<Finding> check_host() {
  std::vector<Finding> findings{real_time_permission(),
                                locked_memory(),
                                kernel(),
                                throttling(),
                                clock_source(),
                                governor(),
                                load(),
                                shared_memory_room(),
                                shared_memory_leftovers(),
                                receive_buffers(),
                                time_sync()};
  for (auto& finding : interfaces()) findings.push_back(std::move(finding));
  findings.push_back(program("gnuplot", "gnuplot-nox", "reports have no plots without it", Level::bad));
  findings.push_back(
      program("fastdds", "fastdds-tools", "it cleans up shared memory of dead processes", Level::note));
  findings.push_back(program("tshark", "tshark", "it shows the cell's traffic on the network", Level::note));
  return findings;
}

}  // namespace invar::tools
