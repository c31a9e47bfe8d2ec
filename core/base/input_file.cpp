#include "core/base/input_file.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <mutex>
#include <string_view>

#include "core/base/fault.hpp"

namespace invar {

namespace {

/// Is nobody there to write, and nothing left to read? Looks without taking anything.
bool is_without_writer(int pipe) {
  std::array<int, 2> aside{};
  if (pipe2(aside.data(), O_CLOEXEC) != 0) return false;
  const bool nobody = tee(pipe, aside[1], 1, SPLICE_F_NONBLOCK) == 0;
  for (const int end : aside) close(end);
  return nobody;
}

/// What is wrong with it, empty where something comes.
std::string_view wait_for_writer(int pipe) {
  constexpr int look = 250, looks = 20;  // ms, times
  for (int i = 0; i < looks; ++i) {
    pollfd readable{pipe, POLLIN, 0};
    if (poll(&readable, 1, look) > 0) return {};
    if (is_without_writer(pipe)) return "is a pipe into which nobody has written";
  }
  return "is a pipe into which nobody has written for five seconds";
}

}  // namespace

namespace {
std::mutex last_lock;
std::string last_opened;  // NOLINT: one for the process
}  // namespace

void note_input(const std::filesystem::path& file) {
  const std::lock_guard lock{last_lock};
  last_opened = file.string();
}
std::string last_input() {
  const std::lock_guard lock{last_lock};
  return last_opened;
}

int open_input(const std::filesystem::path& file, const std::string& named) {
  note_input(file);
  const auto refuse = [&](int opened, std::string_view what) {
    if (opened >= 0) close(opened);
    throw InputError{file.string(), std::string{what}, "name " + named};
  };
  const int opened = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat about {};
  if (opened < 0 || fstat(opened, &about) != 0) {
    if (opened >= 0) close(opened);
    throw InputError{file.string(), "cannot be read", "check the path and its permissions"};
  }
  if (S_ISDIR(about.st_mode)) refuse(opened, "is a folder");
  if (S_ISFIFO(about.st_mode)) {
    if (const auto wrong = wait_for_writer(opened); !wrong.empty()) refuse(opened, wrong);
  } else if (!S_ISREG(about.st_mode)) {
    refuse(opened, "is a device and no file");
  }
  (void)fcntl(opened, F_SETFL, O_RDONLY);  // from here on as any file
  return opened;
}

}  // namespace invar
