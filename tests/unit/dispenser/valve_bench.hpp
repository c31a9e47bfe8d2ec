// A valve on a stage that moves by a closed form, with everything in order unless a test says otherwise.
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "components/dispenser/valve.hpp"

namespace invar::dispenser::testing {

using namespace dispensing;

/// A stage on a path of closed form, and everything else in order unless a test says otherwise.
struct Bench final : Component {
  Output<stage::AxisState> state_x{*this, "state_x"};
  Output<stage::AxisState> state_y{*this, "state_y"};
  Output<PressureState> pressure{*this, "pressure"};
  Output<thermal::NodeTemperature> temperature{*this, "temperature"};
  Output<TriggerPattern> pattern{*this, "pattern"};
  Output<TriggerCommand> command{*this, "command"};
  Inbox<ValvePulse> pulses{*this, "pulses", {}, 4096};
  Inbox<DropletJetted> jetted{*this, "jetted", {}, 4096};
  Inbox<DropletRefused> refused{*this, "refused", {}, 4096};
  Input<ValveState> state{*this, "state"};

  Valve::Parameters parameters;
  std::unique_ptr<Valve> valve;
  std::uint64_t cycle = 0;
  double correction = 0.0;
  bool stage_ready = true, stage_speaks = true, pressure_speaks = true;
  PressureState air;
  std::optional<double> degrees;
  static constexpr double period = 1e-3;

  struct Axis {
    double position, velocity, acceleration;
  };
  std::function<Axis(double)> x = [](double t) { return Axis{0.05 * t, 0.05, 0.0}; };

  Bench() {
    air.enabled(true);
    air.in_band(true);
    air.pressure(67e3);
  }
  void bring_up() {
    valve = std::make_unique<Valve>(parameters);
    for (auto [output, port] :
         std::initializer_list<std::pair<OutputPort*, const char*>>{{&state_x, "state_x"},
                                                                    {&state_y, "state_y"},
                                                                    {&pressure, "pressure"},
                                                                    {&temperature, "temperature"},
                                                                    {&pattern, "pattern"},
                                                                    {&command, "command"}})
      output->connect(*static_cast<InputPort*>(valve->find_port(port)));
    for (auto [port, input] : std::initializer_list<std::pair<const char*, InputPort*>>{
             {"pulse", &pulses}, {"jetted", &jetted}, {"refused", &refused}, {"state", &state}})
      static_cast<OutputPort*>(valve->find_port(port))->connect(*input);
    valve->configure();
    valve->activate();
  }
  void step(const Tick&) noexcept override {}

  /// Points at these x, on the path, each with this lead.
  void load(const std::vector<double>& aims, double lead = 0.0, double beside = 0.0) {
    TriggerPattern sample;
    sample.id(7);
    for (std::size_t i = 0; i < aims.size(); ++i) {
      TriggerPoint point;
      point.droplet(i + 1);
      point.position({aims[i], beside, 0.002});
      point.target({aims[i], beside, 0.0});
      point.lead_ns(Duration::seconds(lead).ns);
      sample.points().push_back(point);
    }
    pattern.write(sample);
    send(TRIGGER_ARM);
  }
  void send(TriggerCommandKind kind) {
    TriggerCommand sample;
    sample.id(cycle + 100);
    sample.kind(kind);
    sample.pattern_id(7);
    command.write(sample);
  }
  void cycle_once() {
    const Tick tick{Instant{} + Duration::milliseconds(1) * static_cast<std::int64_t>(cycle), period, cycle};
    set_now(tick.now);
    valve->set_now(tick.now);
    const Axis at = x(tick.now.in_seconds());
    stage::AxisState sample;
    sample.at().time_ns(tick.now.ns);
    sample.position(at.position + correction);
    sample.correction(correction);
    sample.setpoint_velocity(at.velocity);
    sample.setpoint_acceleration(at.acceleration);
    sample.enabled(stage_ready);
    sample.homed(true);
    if (stage_speaks) state_x.write(sample);
    stage::AxisState still = sample;
    still.position(0.0);
    still.correction(0.0);
    still.setpoint_velocity(0.0);
    still.setpoint_acceleration(0.0);
    if (stage_speaks) state_y.write(still);
    if (pressure_speaks) pressure.write(air);
    if (degrees) {
      thermal::NodeTemperature warmth;
      warmth.temperature(*degrees);
      temperature.write(warmth);
    }
    valve->step(tick);
    ++cycle;
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) cycle_once();
  }
  std::vector<DropletJetted> all_jetted() {
    std::vector<DropletJetted> all;
    for (DropletJetted one; jetted.take(one);) all.push_back(one);
    return all;
  }
  /// The reasons of all refusals, in order.
  std::vector<RefusalReason> reasons() {
    std::vector<RefusalReason> all;
    for (DropletRefused one; refused.take(one);) all.push_back(one.reason());
    return all;
  }
};

}  // namespace invar::dispenser::testing
