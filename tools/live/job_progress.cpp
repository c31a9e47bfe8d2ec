#include "tools/live/job_progress.hpp"
#include "tools/live/terminal.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <iostream>

namespace invar::tools {

namespace {

/// A line that wraps is not rewritten as one.
std::string fitted(const std::string& line) {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col < 20 || line.size() < size.ws_col)
    return line;
  std::size_t end = size.ws_col - 1U;
  while (end > 0 && (static_cast<unsigned char>(line[end]) & 0xC0U) == 0x80U) --end;  // no half letter
  return line.substr(0, end);
}

}  // namespace

void JobProgress::show(double fraction, const std::string& text) {
  const bool screen = isatty(STDERR_FILENO) != 0;
  const std::string line = std::to_string(std::lround(fraction * 100.0)) + " %  " + text;
  const std::string& news = screen ? line : text;
  if (news == last_) return;
  last_ = news;
  if (screen)
    steer(std::cerr, clear_line), std::cerr << fitted(line) << std::flush;
  else
    std::cerr << line + '\n' << std::flush;
  open_ = screen;
}

void JobProgress::end() {
  if (open_) std::cerr << '\n';
  open_ = false;
}

}  // namespace invar::tools
