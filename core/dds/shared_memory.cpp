#include "core/dds/shared_memory.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ctime>
#include <string>
#include <vector>

namespace invar::dds {

namespace {

double seconds_since(const timespec& time) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<double>(now.tv_sec - time.tv_sec) +
         1e-9 * static_cast<double>(now.tv_nsec - time.tv_nsec);
}

/// Nobody reads a lock file: the time of its last access serves to remember when it was first found abandoned.
bool has_rested(const std::filesystem::path& lock, Duration rest) {
  struct stat status {};
  if (stat(lock.c_str(), &status) != 0) return false;
  const bool is_marked = status.st_atim.tv_sec > status.st_mtim.tv_sec;
  if (is_marked) return seconds_since(status.st_atim) >= rest.in_seconds();
  const timespec times[2] = {{0, UTIME_NOW}, {0, UTIME_OMIT}};
  utimensat(AT_FDCWD, lock.c_str(), times, 0);
  return rest.ns == 0;
}

/// False also when it cannot be opened: then it is not ours to remove.
bool is_abandoned(const std::filesystem::path& lock, Duration age) {
  const int file = open(lock.c_str(), O_RDWR | O_CLOEXEC);
  if (file < 0) return false;
  struct stat status {};
  const bool abandoned = fstat(file, &status) == 0 && seconds_since(status.st_mtim) >= age.in_seconds() &&
                         flock(file, LOCK_EX | LOCK_NB) == 0;
  close(file);
  return abandoned;
}

void remove(const std::filesystem::path& folder, const std::string& subject) {
  std::error_code error;
  std::filesystem::remove(folder / subject, error);
  std::filesystem::remove(folder / ("sem." + subject + "_mutex"), error);
  for (const char* lock : {"_el", "_sl"}) std::filesystem::remove(folder / (subject + lock), error);
}

/// A port whose lock a peer of the dead process has removed: nobody listens there.
bool is_unlocked_port(const std::filesystem::path& folder, const std::string& name, Duration age) {
  struct stat status {};
  return name.starts_with("fastrtps_port") && name.find('_', 13) == std::string::npos &&
         !std::filesystem::exists(folder / (name + "_el")) &&
         !std::filesystem::exists(folder / (name + "_sl")) && stat((folder / name).c_str(), &status) == 0 &&
         seconds_since(status.st_mtim) >= age.in_seconds();
}

}  // namespace

std::size_t remove_shared_memory_leftovers(const std::filesystem::path& folder, Duration age, Duration rest) {
  std::error_code error;
  std::vector<std::filesystem::path> locks;
  std::vector<std::string> unlocked;
  for (const auto& entry : std::filesystem::directory_iterator{folder, error}) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("fastrtps_") && (name.ends_with("_el") || name.ends_with("_sl")))
      locks.push_back(entry.path());
    if (is_unlocked_port(folder, name, rest * 2)) unlocked.push_back(name);
  }
  for (const auto& name : unlocked) remove(folder, name);
  std::size_t removed = unlocked.size();
  for (const auto& lock : locks) {
    if (!is_abandoned(lock, age) || !has_rested(lock, rest)) continue;
    const std::string name = lock.filename().string();
    remove(folder, name.substr(0, name.size() - 3));
    ++removed;
  }
  return removed;
}

}  // namespace invar::dds
