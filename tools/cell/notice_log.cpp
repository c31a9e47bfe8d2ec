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
}

void NoticeLog::write(const event::Notice& notice) {
  if (notice.level() == event::SEVERITY_NOTE) return;
  const auto now = std::chrono::steady_clock::now();
  std::string line = std::string{notice.source().c_str()} + ": " + notice.text().c_str();
  {
    const std::scoped_lock lock{mutex_};
    if (said_.size() > remembered_most) said_.clear();
    const auto [said, is_new] =
        said_.try_emplace({notice.source().c_str(), notice.text().c_str()}, Said{now, 0});
    if (!is_new && now - said->second.at < repeats_after) {
      ++said->second.more;
      return;
    }
    if (said->second.more > 0)
      line += " (" + std::to_string(said->second.more) + " times more since the last line)";
    said->second = {now, 0};
  }
  if (simulated_) line = "at " + shown(static_cast<double>(notice.at().time_ns()) * 1e-9, 6) + " s: " + line;
  spdlog::log(level_of(notice.level()), "{}", line);
}

}  // namespace invar::tools
