// Dispenser: the pneumatic controller of a jetting head over Modbus TCP, and where to aim its droplets.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/dispenser/pattern.hpp"
#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "core/component/parameters.hpp"
#include "core/component/staged_model.hpp"
#include "core/metrology/droplet/droplet_trajectory.hpp"
#include "core/modbus/contract.hpp"
#include "core/modbus/endpoint.hpp"
#include "idl/dispensing.h"

namespace invar::dispenser {

/// The slow half of a dispenser, for a worker; `valve` in the motion loop is the fast one. Keeps pressure and purge pressure at
/// their setpoints, switches both off on a latched alarm, and refreshes the controller's heartbeat: when this process dies, the
/// controller vents by itself. Answers a pattern command with the pattern's targets moved by the trajectory model in use. The
/// model is compensation.yaml of kind dispenser, or a diagnosis's model.yaml of plant droplet, as a StagedModel. It also switches off
/// while the pressure that the controller shows is impossible (outside the range of its register) and while the controller
/// refuses writes, and says so in notices. Not real-time (Modbus).
class Dispenser final : public Component {
 public:
  struct Parameters {
    modbus::Endpoint modbus;
    double pressure = 67.2e3;
    double purge_pressure = 20e3;
    double band = 500.0;
    bool pressurise = false;
    std::filesystem::path model;
    double bound = 2e-3;
    double largest_sigma = 1e-4;
    std::vector<Pattern> patterns;
    void describe(auto& p) {
      p(modbus, "modbus", "the pneumatic controller");
      p(pressure, "pressure", "Pa", Range{0.0, 7e5}, "over ambient; a command changes it");
      p(purge_pressure, "purge_pressure", "Pa", Range{0.0, 7e5},
        "pressure of the purge line; a command changes it");
      p(band, "band", "Pa", Range{10.0, 5e4}, "in band: pressure no farther from its setpoint");
      p(pressurise, "pressurise", "from the start; otherwise by command");
      p(model, "model",
        "compensation.yaml (dispenser) or model.yaml (droplet) in use from the start; none: targets stay as "
        "they are");
      p(bound, "bound", "m", Range{0.0, 0.1}, "a model that moves a target farther is refused");
      p(largest_sigma, "largest_sigma", "m", Range{0.0, 0.1},
        "a pattern at a height where the model is less certain is refused");
      p(patterns, "patterns", "that can be asked for");
    }
  };

  /// Registers that its device's map must and may hold.
  static const modbus::RegisterContract& registers();
  explicit Dispenser(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override;
  void configure() override;
  void activate() override;
  void deactivate() noexcept override;
  void cleanup() noexcept override;
  void step(const Tick& tick) noexcept override;
  [[nodiscard]] bool has_latch() const noexcept override { return true; }
  void reset_latch() noexcept override;  // and that of the device

 private:
  using Staged = StagedModel<metrology::DropletTrajectory>;  // none: targets stay as they are
  [[nodiscard]] std::string load(const std::filesystem::path& file, Staged::Model& model) const;
  void obey(const dispensing::PressureCommand& command) noexcept;
  void answer(const dispensing::PatternCommand& command);
  [[nodiscard]] std::string fill(const dispensing::PatternCommand& command,
                                 dispensing::TriggerPattern& pattern);
  /// Registers of a line, as far as the map has them.
  struct Line {
    std::optional<std::size_t> setpoint, valve, actual;
  };
  void drive(bool enable) noexcept;
  void drive(const Line& line, double setpoint, bool open) noexcept;
  [[nodiscard]] bool is_open(const Line& line, bool told) const;
  void publish() noexcept;
  /// Range of setpoints by command or parameter [Pa].
  static constexpr Range settable{1.0, 7e5};

  const Parameters& parameters_;
  Inbox<dispensing::PressureCommand> command_{*this, "command", {.optional = true, .profile = "command"}};
  Inbox<dispensing::PatternCommand> wanted_pattern_{*this, "print", {.optional = true, .profile = "command"}};
  Output<dispensing::PressureState> pressure_{*this, "pressure", "state"};
  Output<dispensing::TriggerPattern> pattern_{*this, "pattern", "command"};

  Notices notices_{*this};
  modbus::RegisterMap map_;
  std::string device_;  // in words
  Line reservoir_, purge_line_;
  struct {
    std::optional<std::size_t> in_band, supply_low, over_pressure, sensor_fault, comm_lost;
  } flags_;
  std::optional<std::size_t> band_, reset_alarms_;
  modbus::Client client_;
  Range pressures_, purge_pressures_;  // that the map and `settable` both take
  std::map<std::string, std::vector<Eigen::Vector2d>> patterns_;
  Staged model_;
  double setpoint_ = 0.0;
  double purge_setpoint_ = 0.0;
  bool wanted_ = false;
  bool purge_ = false;
  bool driven_ = false;   // told to hold its pressure
  bool latched_ = false;  // by an alarm, until a person resets it
  Instant reset_at_;
  std::uint64_t next_droplet_ = 1;
};

}  // namespace invar::dispenser
