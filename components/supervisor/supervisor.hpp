// Supervisor: watches the processes and components of a cell, says what went wrong, and makes safe what depended on it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"

namespace invar::supervisor {

/// The supervisor's view of the cell and its means; the process that runs it connects it to the middleware.
struct CellView {
  struct Seen {
    std::string failure;  // of a component in error; empty otherwise
    bool in_error = false;
    bool active = false;
  };
  /// Processes heard of since the last call, by name.
  std::function<std::set<std::string>()> heard;
  std::function<std::map<std::string, Seen>()> components;
  /// Deactivates a component; an empty text when that was done.
  std::function<std::string(const std::string& component)> deactivate;
  /// Activates a component; an empty text when that was done.
  std::function<std::string(const std::string& component)> activate;
  /// Components that act on a device as soon as they are active: a person activates them again.
  std::set<std::string> held;
  std::function<void(bool is_fault, const std::string& source, const std::string& text)> notify;
  std::vector<std::string> processes;                          // all that should be there
  std::map<std::string, std::string> process_of;               // component -> process
  std::map<std::string, std::vector<std::string>> dependents;  // component -> those that need its outputs
};

/// Answers a process that is not heard of for `timeout`, or a component in error. Everything that needs its outputs, directly
/// or through others, is deactivated, downstream first, and notices say so. The devices' own watchdogs and the
/// components' deadlines have acted long before; this keeps the rest of the cell from going on as if nothing were.
/// A step that comes later than half of `timeout` after the one before begins all waiting anew.
class Supervisor final : public Component {
 public:
  struct Parameters {
    double timeout = 2.0;
    double start_timeout = 30.0;
    bool make_safe = true;
    void describe(auto& p) {
      p(timeout, "timeout", "s", Range{0.5, 600.0}, "a process not heard of for so long is lost",
        while_running);
      p(start_timeout, "start_timeout", "s", Range{0.5, 600.0},
        "one never heard of since the start, for so long", while_running);
      p(make_safe, "make_safe", "deactivate what depends on a lost process or a failed component");
    }
  };
  explicit Supervisor(const Parameters& parameters) : parameters_{parameters} {}
  void activate() override;
  void step(const Tick& tick) noexcept override;

  /// Before the first step.
  void connect(CellView view) { view_ = std::move(view); }

 private:
  void forgive_own_gap(const Tick& tick);
  void watch_processes(const Tick& tick);
  void watch_components();
  void make_safe(const std::set<std::string>& failed);
  void bring_back();
  [[nodiscard]] bool has_all_it_needs(const std::string& component,
                                      const std::map<std::string, CellView::Seen>& seen) const;

  const Parameters& parameters_;
  CellView view_;
  Instant began_, last_step_;
  bool acted_ = false;                         // in the step before
  std::map<std::string, Instant> last_heard_;  // only those that were
  std::set<std::string> lost_;
  std::set<std::string> failed_;
  std::vector<std::string> put_down_;  // deactivated here, downstream first
};

/// Everything downstream of `failed` in `dependents`, those furthest downstream first, `failed` itself left out.
std::vector<std::string> downstream(const std::map<std::string, std::vector<std::string>>& dependents,
                                    const std::set<std::string>& failed);

}  // namespace invar::supervisor
