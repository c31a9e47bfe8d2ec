#include "tools/cell/children_watch.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>

#include "core/base/shown.hpp"

namespace invar::tools {

ChildrenWatch::ChildrenWatch(const ServiceManager& manager, const std::filesystem::path& folder)
    : manager_{manager} {
  if (!manager_.is_there()) return;
  const std::string file = (folder / "notify").string();
  socket_ = std::make_unique<ServiceSocket>(file);
  setenv("NOTIFY_SOCKET", file.c_str(), 1);
  if (manager_.watchdog() > 0.0)
    setenv("WATCHDOG_USEC", std::to_string(static_cast<std::uint64_t>(5e5 * manager_.watchdog())).c_str(), 1);
}

void ChildrenWatch::hear() {
  while (const auto message = socket_->take()) {
    Life& life = lives_[message->pid];
    const bool ready = has_line(message->lines, "READY=1"), fed = has_line(message->lines, "WATCHDOG=1");
    life.ready = life.ready || ready;
    if (!ready && !fed) continue;
    life.fed = Clock::now();
    life.fed_since = true;
  }
}

void ChildrenWatch::tell_status(const std::vector<Child>& children) {
  std::string missing;
  std::size_t up = 0;
  for (const Child& child : children) {
    if (child.running && lives_[child.pid].ready)
      ++up;
    else
      missing += (missing.empty() ? "; not up: " : ", ") + child.name;
  }
  manager_.status(std::to_string(up) + " of " + std::to_string(children.size()) + " processes up" + missing);
  if (ready_ || up < children.size()) return;
  ready_ = true;
  manager_.ready();
}

std::vector<pid_t> ChildrenWatch::look(const std::vector<Child>& children) {
  if (!socket_) return {};
  hear();
  std::erase_if(lives_, [&](const auto& life) {
    return std::none_of(children.begin(), children.end(),
                        [&](const Child& child) { return child.pid == life.first; });
  });
  tell_status(children);
  if (manager_.watchdog() <= 0.0) return {};
  std::vector<pid_t> hung;
  bool all_fed = true;
  for (const Child& child : children) {
    Life& life = lives_[child.pid];
    if (!child.running || !life.ready) continue;
    all_fed = all_fed && life.fed_since;
    const double silent = std::chrono::duration<double>(Clock::now() - life.fed).count();
    if (silent < manager_.watchdog() / 2.0) continue;
    spdlog::error("process `{}` made no cycle for {} s: it is ended", child.name, shown(silent));
    hung.push_back(child.pid);
    life.fed = Clock::now();  // once; a process that does not end starves the service manager
    life.fed_since = false;
    all_fed = false;
  }
  if (!all_fed) return hung;
  manager_.feed(++meals_);
  for (auto& [pid, life] : lives_) life.fed_since = false;
  return hung;
}

}  // namespace invar::tools
