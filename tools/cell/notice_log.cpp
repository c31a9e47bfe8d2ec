#include "tools/cell/notice_log.hpp"

#include <spdlog/spdlog.h>

#include "core/base/shown.hpp"

namespace invar::tools {

namespace {

constexpr std::size_t waiting_most = 32;  // of one component, between two looks 20 ms apart
constexpr std::size_t remembered_most = 1000;
constexpr auto repeats_after = std::chrono::seconds{10};

spdlog::level::level_enum level_of(event::Severity severity) {
  switch (severity) {
    case event::SEVERITY_NOTE:
      return spdlog::level::debug;
    case event::SEVERITY_WARNING:
      return spdlog::level::warn;
    case event::SEVERITY_FAULT:
      return spdlog::level::err;
    case event::SEVERITY_TRIP:
      break;
  }
  return spdlog::level::critical;
}

}  // namespace

void NoticeLog::follow(Port& port) {
  auto* output = dynamic_cast<Output<event::Notice>*>(&port);
  if (output == nullptr) return;
  Ring<event::Notice>& ring = waiting_.emplace_back(waiting_most);
  output->add_sink([&ring](const event::Notice& notice, Instant) {
    if (notice.level() != event::SEVERITY_NOTE) ring.push(notice);
  });
}

void NoticeLog::write_waiting() {
  event::Notice notice;
  std::uint64_t lost = 0;
  for (Ring<event::Notice>& ring : waiting_) {
    while (ring.pop(notice)) write(notice);
    lost += ring.lost();
  }
  if (lost > told_lost_) spdlog::warn("{} notices came too fast to be written here", lost - told_lost_);
  told_lost_ = lost;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_count_) return;
  next_count_ = now + std::chrono::seconds{1};
  write_repeated(repeats_after);
}

void NoticeLog::write_last() {
  write_waiting();
  write_repeated({});
}

void NoticeLog::write(const event::Notice& notice) {
  if (notice.level() == event::SEVERITY_NOTE) return;
  const auto now = std::chrono::steady_clock::now();
  {
    const std::scoped_lock lock{mutex_};
    if (said_.size() > remembered_most) said_.clear();
    const auto [said, is_new] =
        said_.try_emplace({notice.source().c_str(), notice.text().c_str()}, Said{now});
    if (!is_new) {
      ++said->second.more;
      said->second.newest = notice;
      return;
    }
  }
  write_line(notice, 0);
}

/// A text that was said again after its line is told with its count some time after that line, and forgotten otherwise.
void NoticeLog::write_repeated(std::chrono::steady_clock::duration after) {
  const auto now = std::chrono::steady_clock::now();
  const std::scoped_lock lock{mutex_};
  for (auto said = said_.begin(); said != said_.end();) {
    if (now - said->second.at < after) {
      ++said;
    } else if (said->second.more == 0) {
      said = said_.erase(said);
    } else {
      write_line(said->second.newest, said->second.more);
      said->second = {now};
      ++said;
    }
  }
}

void NoticeLog::write_line(const event::Notice& notice, std::uint64_t more) const {
  std::string line = std::string{notice.source().c_str()} + ": " + notice.text().c_str();
  if (more > 0) line += " (" + std::to_string(more) + " times more since the last line)";
  if (simulated_) line = "at " + shown(static_cast<double>(notice.at().time_ns()) * 1e-9, 6) + " s: " + line;
  spdlog::log(level_of(notice.level()), "{}", line);
}

}  // namespace invar::tools
