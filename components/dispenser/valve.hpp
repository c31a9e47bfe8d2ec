// Valve: opens the jetting valve at the right place, or says why not.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "components/dispenser/crossing.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "idl/dispensing.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::dispenser {

/// Holds a pattern and, while armed, commands a valve pulse for every point that the nozzle passes. The time of passage is
/// interpolated inside the cycle. The pulse comes earlier by the droplet's lead (velocity carry and delay). Positions are
/// those of the machine: encoder minus the compensation's correction. Each point is jetted once or refused once. Pulses are
/// given only in state active, with a fresh pressure in band, a stage that is ready, and inside the windows below. Runs in the
/// motion loop. Real-time.
class Valve final : public Component {
 public:
  struct Spike {
    double time = 1e-4;
    double current = 3.0;
    void describe(auto& p) {
      p(time, "time", "s", Range{0.0, 1e-2}, "how long the high current opens the valve");
      p(current, "current", "A", Range{0.0, 100.0}, "that opens it");
    }
  };
  struct Parameters {
    double pulse = 180e-6;
    Range pulses{120e-6, 2e-3};
    Spike spike;
    double hold_current = 0.5;
    double most_rate = 1000.0;
    double ahead = 1e-3;
    double beside = 5e-5;
    double margin = 1e-3;
    Range velocity{1e-3, 0.1};
    Range temperature{10.0, 60.0};
    double pressure_timeout = 0.3;
    double stage_timeout = 0.003;
    void describe(auto& p) {
      p(pulse, "pulse", "s", Range{1e-5, 1e-2}, "on-time of the valve, where a pattern says none");
      p(pulses, "pulses", "s", "on-times at which the valve is known to open and close");
      p(spike, "spike", "that opens the valve");
      p(hold_current, "hold_current", "A", Range{0.0, 100.0}, "that holds it open for the rest of the pulse");
      p(most_rate, "most_rate", "Hz", Range{60.0, 1000.0}, "a droplet due sooner after the last is refused");
      p(ahead, "ahead", "s", Range{0.0, 0.1}, "pulses are given to the driver at least this long before");
      p(beside, "beside", "m", Range{1e-7, 1e-2}, "a point is passed when the path leads by it no farther");
      p(margin, "margin", "m", Range{0.0, 0.1}, "around the pattern's targets, for a droplet by command");
      p(velocity, "velocity", "m/s", "velocities of the stage at which droplets are jetted");
      p(temperature, "temperature", "degC", "in which droplets are jetted, where `temperature` is connected");
      p(pressure_timeout, "pressure_timeout", "s", Range{1e-3, 60.0}, "older pressure: nothing is jetted");
      p(stage_timeout, "stage_timeout", "s", Range{1e-4, 1.0}, "older stage state: nothing is jetted");
      if constexpr (requires { p.node(); }) {
        if (!pulses.contains(pulse))
          p.node()["pulse"].fault("is outside `pulses`", "choose an on-time at which the valve works");
        if (spike.time > pulses.lower)
          p.node()["spike"].fault("is longer than the shortest of `pulses`", "shorten the spike");
      }
    }
  };
  explicit Valve(const Parameters& parameters) : parameters_{parameters} {}
  void configure() override;
  void activate() override;
  void deactivate() noexcept override;
  void step(const Tick& tick) noexcept override;

  static constexpr std::size_t most_points = 4096;

 private:
  struct Refusal {
    dispensing::RefusalReason reason;
    const char* text;
  };
  void obey(const dispensing::TriggerCommand& command, const Tick& tick) noexcept;
  [[nodiscard]] std::optional<Motion> motion(const Tick& tick) noexcept;
  [[nodiscard]] std::optional<Refusal> refusal(std::int64_t pulse_ns, std::int64_t open_ns,
                                               const Tick& tick) noexcept;
  void jet(const dispensing::TriggerPoint& point, const Motion& at, std::int64_t open_ns, Range velocity,
           const Tick& tick) noexcept;
  void refuse(std::uint64_t droplet, const Refusal& why) noexcept;
  void jet_now(std::int64_t pulse_ns, const Tick& tick) noexcept;
  void disarm() noexcept;
  void publish() noexcept;

  const Parameters& parameters_;
  Input<stage::AxisState> state_x_{*this, "state_x"};
  Input<stage::AxisState> state_y_{*this, "state_y"};
  Input<dispensing::PressureState> pressure_{*this, "pressure", {.profile = "state"}};
  Input<thermal::NodeTemperature> temperature_{*this, "temperature", {.optional = true, .profile = "state"}};
  Inbox<dispensing::TriggerPattern> pattern_{*this, "pattern", {.profile = "command"}, 2};
  Inbox<dispensing::TriggerCommand> command_{*this, "command"};
  Output<dispensing::ValvePulse> pulse_{*this, "pulse", "command"};
  Output<dispensing::DropletJetted> jetted_{*this, "jetted", "event"};
  Output<dispensing::DropletRefused> refused_{*this, "refused", "event"};
  Output<dispensing::ValveState> state_{*this, "state", "state"};

  dispensing::TriggerPattern loaded_;  // room for the largest pattern is reserved
  std::vector<char> done_;             // of each of its points
  std::array<Range, 2> box_{};         // around its targets
  dispensing::ValveState sample_;
  std::int64_t clock_ns_ = 0;  // now, on the clock of the stage's stamps
  std::int64_t last_open_ns_ = 0;
  bool changed_ = false;
};

}  // namespace invar::dispenser
