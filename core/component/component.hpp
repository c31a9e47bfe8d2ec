// Component: the unit that an engineer writes. It has ports and parameters and is stepped; it owns no thread
// and no clock.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/time.hpp"

namespace invar {

class CellFolders;
class ModelCourier;
class Port;
class InputPort;

/// One call of a component's step.
struct Tick {
  Instant now;          // the nominal start of this cycle: UTC, or simulated time; the clock of all stamps
  double period = 0.0;  // s, nominal, to the next step; longer than its own while the rate of the loop is lowered
  std::uint64_t cycle = 0;  // counts every period since the executor started, skipped ones too
  double own_period = period;  // s, at the full rate
};

/// The states of the OMG RTC / ROS 2 lifecycle; core/component/lifecycle.hpp has the transitions.
enum class LifecycleState : std::uint8_t { unconfigured, inactive, active, finalized, error };

/// Derive, declare `struct Parameters` with `describe`, declare ports as members, write `step`. The
/// constructor takes `const Parameters&`, which outlives the component: keep the reference to see changes
/// made while running.
class Component {
 public:
  Component() = default;
  virtual ~Component() = default;
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;

  /// unconfigured -> inactive. May allocate, open files and connections, throw InputError. Not on the loop's
  /// thread.
  virtual void configure() {}
  /// inactive -> active, on the thread that steps, before the first step. Must be bumpless: setpoint :=
  /// measured; `starts_at` lets the executor check it. Real-time where the executor is.
  virtual void activate() {}
  /// The work of one period. Real-time where the executor is: neither allocates, locks, throws, logs nor
  /// waits.
  virtual void step(const Tick& tick) noexcept = 0;
  /// active -> inactive, on the thread that steps. Afterwards the outputs get their safe values.
  virtual void deactivate() noexcept {}
  /// Before `deactivate`, once a cycle on the thread that steps: is it at rest? While it says no it goes on being stepped
  /// (a stage brakes), but not for longer than the executor allows. Real-time.
  virtual bool wind_down() noexcept { return true; }
  /// inactive or error -> unconfigured: give back what configure took. Not on the loop's thread.
  virtual void cleanup() noexcept {}
  /// An input with a deadline is older than that while active, called once a period on the thread that steps.
  /// True: the component deals with it itself (the stage stops under control); false: it goes to error at
  /// once.
  virtual bool input_lost(const InputPort& input, const Tick& tick) noexcept;
  /// Whether it has a protection that, once tripped, holds until a person resets it. Set-up.
  [[nodiscard]] virtual bool has_latch() const noexcept { return false; }
  /// A person resets that protection while the component is active, on the thread that steps. Real-time.
  virtual void reset_latch() noexcept {}
  /// A parameter declared `while_running` was changed, on the thread that steps, between two steps.
  /// Real-time.
  virtual void parameters_changed() noexcept {}

  /// From step: this component cannot go on. It goes to error after this step, its outputs to their safe
  /// values. `why` must be a literal. Real-time.
  void fail(const char* why) noexcept { failure_ = why; }
  [[nodiscard]] const char* failure() const noexcept { return failure_; }
  void clear_failure() noexcept { failure_ = nullptr; }

  /// Set-up: after activation, `setpoint` must equal `measured` within `tolerance`, or the component goes to
  /// error instead of jumping. Checked once, as soon as both are finite: directly after `activate`, or after
  /// the first step in which they are (start with NaN when there is nothing measured yet). Both must live as
  /// long as the component.
  void starts_at(const double& setpoint, const double& measured, double tolerance) {
    bumpless_.push_back({&setpoint, &measured, tolerance});
  }
  struct Bumpless {
    const double* setpoint;
    const double* measured;
    double tolerance;
  };
  [[nodiscard]] const std::vector<Bumpless>& bumpless() const noexcept { return bumpless_; }

  /// Something of the plant that only one component of a cell may have: the drive of an axis, a device, a port.
  struct Claim {
    std::string what;                // "the drive of axis 0"
    std::string parameter;           // that chose it
    bool of_this_pc = false;         // another PC has one of the same name: a loopback address, a file
    bool shared_in_process = false;  // the components of one process may share it: a connection
  };
  /// Set-up: what is this component's alone; two that claim the same are a fault of the deployment.
  [[nodiscard]] virtual std::vector<Claim> claims() const { return {}; }

  /// Why a component cannot do its work, and how to mend it.
  struct Unfit {
    std::string why;
    std::string parameter;  // at which it is told
    std::string mend;
  };
  /// Set-up: must it not be stepped every `period` [s]? Then that is a fault of the deployment. Throws nothing.
  [[nodiscard]] virtual std::optional<Unfit> unfit(double /*period*/) const { return {}; }

  /// The name in the deployment ("stage_x"). Set before configure.
  std::string name;
  /// Numeric identity of the cell and of this component, for the keys of its samples. Set before configure.
  std::uint32_t cell = 0;
  std::uint32_t id = 0;
  /// Where files lie that a command may name; null: everywhere, as in a test. Set before configure.
  std::shared_ptr<const CellFolders> folders;
  /// Brings models to components on other PCs; null: every file is found where it was written. Set before configure.
  ModelCourier* courier = nullptr;
  /// Time is simulated: whatever waits for the outside must do so inside `step` (a Modbus exchange), so that runs repeat.
  bool simulated_time = false;

  [[nodiscard]] const std::vector<Port*>& ports() const { return ports_; }
  /// nullptr when there is none of that name.
  [[nodiscard]] Port* find_port(std::string_view port_name) const;
  /// The time of the current step, on the clock that all stamps carry.
  [[nodiscard]] Instant now() const noexcept { return now_; }
  /// Fills what every sample carries: the cell, and when it was made - now, unless something else is known. Real-time.
  template <class Sample>
  void stamp(Sample& sample) const noexcept {
    stamp(sample, now_);
  }
  template <class Sample>
  void stamp(Sample& sample, Instant made) const noexcept {
    sample.cell(cell);
    sample.at().time_ns(made.ns);
    sample.at().cycle(cycle_);
  }
  /// By the executor, before each step and transition.
  void set_now(Instant now, std::uint64_t cycle = 0) noexcept {
    now_ = now;
    cycle_ = cycle;
  }
  /// By the executor: `step`, with one and the same sample of each input from its first look to the end of the step.
  void run_step(const Tick& tick) noexcept {
    running_step_ = ++steps_;
    step(tick);
    running_step_ = 0;
  }
  /// The number of the step that runs, from one; 0: none does. On the thread that steps.
  [[nodiscard]] std::uint64_t running_step() const noexcept { return running_step_; }

 private:
  friend class Port;
  std::vector<Port*> ports_;
  std::vector<Bumpless> bumpless_;
  Instant now_;
  std::uint64_t cycle_ = 0;
  std::uint64_t steps_ = 0;
  std::uint64_t running_step_ = 0;
  const char* failure_ = nullptr;
};

}  // namespace invar

#include "core/component/port.hpp"
