// Thermal: holds a temperature with a heater behind Modbus TCP.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/thermal/heat_watch.hpp"
#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "core/component/parameters.hpp"
#include "core/component/standby.hpp"
#include "core/metrology/thermal/thermistor.hpp"
#include "core/modbus/contract.hpp"
#include "core/modbus/endpoint.hpp"
#include "idl/thermal.h"

namespace invar::thermal {

/// PID with anti-windup from the slide's thermistor to the pad's power. The heater is switched off in these cases:
///
/// - readings are stale, or outside the range of their register or of `measurable`;
/// - the device reports a faulty sensor (register `sensor_fault`, where its map has one) or refuses writes: its own watchdog
///   then switches it off too;
/// - the latch trips: at `over_temperature`, or when the device latches at a limit of its own (register `over_temperature`);
/// - the latch trips when the heat given, however interrupted, does not show in the temperature (`response`): a thermistor
///   that came off or froze, a pad that is dead or too weak.
///
/// The latch holds until a person resets it (`invar lifecycle`, or `reset_latch` of a command), and the device with it (register
/// `reset_alarms`). A notice also names a controller that delivers power though it was told to be off. Each of these is said once
/// in a notice, and once when it is over. A command whose setpoint is no number, outside the parameter's range or not below
/// `over_temperature` can only switch off. Not real-time (Modbus).
class Thermal final : public Component, public Redundant {
 public:
  struct Pid {
    double kp = 20.0;
    double ki = 0.2;
    double kd = 0.0;
    double derivative_filter = 5.0;
    void describe(auto& p) {
      p(kp, "kp", "W/K", Range{0.0, 1e4}, "proportional gain", while_running);
      p(ki, "ki", "W/(K s)", Range{0.0, 1e3}, "integral gain", while_running);
      p(kd, "kd", "W s/K", Range{0.0, 1e5}, "derivative gain, on the measurement", while_running);
      p(derivative_filter, "derivative_filter", "s", Range{0.0, 600.0},
        "time constant of the derivative's filter");
    }
  };
  struct Thermistor {
    double resistance = 1000.0;
    double base_temperature = 25.0;
    double coefficient_percent = 4.4;
    double third_order = 0.0;
    void describe(auto& p) {
      p(resistance, "resistance", "ohm", Range{1.0, 1e7}, "at the base temperature");
      p(base_temperature, "base_temperature", "degC", Range{-50.0, 150.0}, "where that resistance holds");
      p(coefficient_percent, "coefficient", "%/K", Range{1e-3, 20.0}, "loss of resistance per kelvin there");
      p(third_order, "third_order", "1/K", Range{-1e-5, 1e-5},
        "C of the Steinhart-Hart equation in ln(R / 1 ohm); 0: the B law");
    }
  };
  struct Response {
    double rise = 0.5;
    double within = 120.0;
    double hold = 0.5;
    double leap = 5.0;
    void describe(auto& p) {
      p(rise, "rise", "K", Range{1e-3, 50.0}, "by which the slide must warm at full power ...",
        while_running);
      p(within, "within", "s", Range{1.0, 1e5},
        "... in this time; the latch switches off when as much heat, however interrupted, did not warm it so",
        while_running);
      p(hold, "hold", "1", Range{0.0, 0.9},
        "largest share of power_limit that holding a temperature takes: heat below it need not warm the "
        "slide",
        while_running);
      p(leap, "leap", "K", Range{0.1, 200.0},
        "a change of the reading beyond it within a second is a fault of the thermistor", while_running);
    }
  };
  /// A further sensor of the controller: register <name>_resistance or <name>_temperature.
  struct Zone {
    std::string name;
    Thermistor thermistor;
    void describe(auto& p) {
      p(name, "name", "makes the port temperature_<name>");
      p(thermistor, "thermistor", "thermistor of this zone");
    }
  };
  struct Parameters {
    modbus::Endpoint modbus;
    Pid pid;
    Thermistor thermistor;
    std::vector<Zone> zones;
    double setpoint = 30.0;
    double power_limit = 60.0;
    double rated_power = 0.0;
    double over_temperature = 60.0;
    Response response;
    Range measurable{-40.0, 250.0};
    static constexpr Range setpoints{-20.0, 150.0};
    void describe(auto& p) {
      p(modbus, "modbus", "the heater's controller");
      p(pid, "pid", "control law");
      p(thermistor, "thermistor", "thermistor of the slide");
      p(zones, "zones", "further thermistors, read and published but not controlled");
      p(setpoint, "setpoint", "degC", setpoints, "wanted at the start; a command changes it", while_running);
      p(power_limit, "power_limit", "W", Range{0.0, 1e4}, "highest power");
      p(rated_power, "rated_power", "W", Range{0.0, 1e5},
        "at 100 %, for a map whose `power` is in %; 0: not known");
      p(over_temperature, "over_temperature", "degC", Range{0.0, 200.0},
        "the latch switches the heater off above it");
      p(response, "response", "time of response of the thermistor to full power");
      p(measurable, "measurable", "degC", "range of the thermistors; beyond it one is open or short");
      if constexpr (requires { p.node(); })
        if (setpoint >= over_temperature)
          p.node()["setpoint"].fault("is not below `over_temperature`", "lower it, or raise the latch");
    }
  };

  /// Registers that its device's map must and may hold; those of a zone have the zone's name for `slide`.
  static const modbus::RegisterContract& registers();
  explicit Thermal(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override;
  void configure() override;
  void activate() override;
  void deactivate() noexcept override;
  void cleanup() noexcept override;
  bool wind_down() noexcept override;
  void step(const Tick& tick) noexcept override;
  [[nodiscard]] bool has_latch() const noexcept override { return true; }
  void reset_latch() noexcept override;  // and that of the device
  [[nodiscard]] Standby& standby() noexcept override { return standby_; }
  [[nodiscard]] std::optional<Unfit> without_standby() const override;
  template <class W>
  void warm(W& w) noexcept {
    constexpr Range any{-1e12, 1e12};
    w(setpoint_, "setpoint", Parameters::setpoints);
    w(wanted_, "wanted");
    w(latched_, "latched");
    w(integral_, "integral", any);
    w(slope_, "slope", any);
    w(previous_, "previous", any);
    w(primed_, "primed");
    w(power_, "power", Range{0.0, 1e4});
    watch_.warm(w);
  }

 private:
  [[nodiscard]] bool leads(const Tick& tick) noexcept;
  void stand_by(const Tick& tick) noexcept;
  void watch_device(const Tick& tick) noexcept;
  [[nodiscard]] const char* why_not_free(const Tick& tick) const noexcept;
  [[nodiscard]] bool reaches_device() const noexcept;
  [[nodiscard]] double control(double temperature, double period) noexcept;
  void obey(const ThermalCommand& command) noexcept;
  /// A temperature that the device measures: by a thermistor's resistance, or as it converts it itself.
  struct Sensor {
    std::optional<std::size_t> resistance, temperature;  // registers; one at least
    metrology::Thermistor thermistor;
    [[nodiscard]] std::size_t reg() const { return resistance ? *resistance : *temperature; }
  };
  [[nodiscard]] Sensor sensor(const std::string& name, const Thermistor& thermistor) const;
  void find_registers();
  [[nodiscard]] std::optional<double> measured(const Sensor& sensor) const noexcept;
  [[nodiscard]] bool drive(double power, bool enable) noexcept;
  void tell(bool sound, const Tick& tick) noexcept;
  void latch(bool sound, const Tick& tick) noexcept;
  void look_at_delivery(const Tick& tick) noexcept;
  void look_at_response(std::optional<double> reading, const Tick& tick) noexcept;
  [[nodiscard]] HeatWatch::Settings watched() const noexcept;

  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();  // before the first reading
  const Parameters& parameters_;
  Inbox<ThermalCommand> command_{*this, "command", {.optional = true, .profile = "command"}};
  Output<NodeTemperature> state_{*this, "state", "state"};
  Notices notices_{*this};
  Standby standby_{*this, notices_};
  std::optional<ThermalCommand> unanswered_;  // while it stands by: nobody may have heard it
  Instant unanswered_at_;
  double beat_ = 0.0;  // of the device's heartbeat register, seen while standing by
  std::optional<Instant> beat_changed_;
  std::optional<Instant> unready_since_;
  modbus::RegisterMap map_;
  Sensor slide_;
  struct ZoneSensor {
    Sensor sensor;
    std::unique_ptr<Output<NodeTemperature>> output;
    double temperature = unknown;
  };
  void publish_zone(ZoneSensor& zone) noexcept;
  std::vector<ZoneSensor> zones_;
  std::string device_;  // in words
  modbus::Client client_;
  double setpoint_ = 0.0;
  double setpoint_parameter_ = 0.0;
  double temperature_ = unknown;
  double integral_ = 0.0;
  double slope_ = 0.0;
  double previous_ = 0.0;
  bool primed_ = false;
  bool wanted_ = true;
  bool latched_ = false;
  std::size_t power_register_ = 0;
  double power_scale_ = 1.0;  // of the power registers: W of one SI unit
  double delivered_scale_ = 1.0;
  /// Registers that the map may lack.
  std::optional<std::size_t> enable_, delivered_, comm_lost_, sensor_fault_, over_temperature_, reset_alarms_;
  Instant reset_at_{INT64_MIN / 2};
  bool told_unsound_ = false;
  bool told_undriven_ = false;
  bool told_stuck_ = false;
  std::optional<Instant> stuck_since_;    // power flows, and none was asked for
  std::optional<Instant> unsound_since_;  // the device answers, and its sensor cannot be
  double power_ = 0.0;
  HeatWatch watch_;
  double lets_go_ = 0.0;  // how long the device goes on heating without its master [s]
};

}  // namespace invar::thermal
