// ChildrenWatch: which processes of `invar run` are up and make cycles, as a service manager asks.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tools/cell/service_manager.hpp"

namespace invar::tools {

/// Each process feeds its launcher as the launcher feeds systemd. A process whose loop makes no cycle for half the manager's
/// patience is to be ended and started again; the manager is fed while no process is overdue. So systemd ends all of them
/// only where `invar run` itself hangs, or where a process cannot be ended. Without a service manager it does nothing.
class ChildrenWatch {
 public:
  /// `folder`: of ours, for the socket. Sets the environment of the processes that are started later.
  ChildrenWatch(const ServiceManager& manager, const std::filesystem::path& folder);

  struct Child {
    std::string name;
    pid_t pid = -1;
    bool running = false;
  };
  /// Hears the news, tells the service manager, and names the processes to end: SIGKILL.
  [[nodiscard]] std::vector<pid_t> look(const std::vector<Child>& children);
  void stopping() const { manager_.stopping(); }

 private:
  using Clock = std::chrono::steady_clock;
  struct Life {
    bool ready = false, fed_since = false;  // ... the manager was fed
    Clock::time_point fed{};
  };
  void hear();
  void tell_status(const std::vector<Child>& children);

  ServiceManager manager_;
  std::unique_ptr<ServiceSocket> socket_;
  std::map<pid_t, Life> lives_;
  std::uint64_t meals_ = 0;
  bool ready_ = false;
};

}  // namespace invar::tools
