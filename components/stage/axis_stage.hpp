// Stage: the servo of one axis - commands, trajectory, control law, limits and a controlled stop.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "components/stage/homing.hpp"
#include "components/stage/input_watch.hpp"
#include "components/stage/trajectory.hpp"
#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "core/component/parameters.hpp"
#include "core/component/staged_model.hpp"
#include "core/component/standby.hpp"
#include "core/physics/axis_controller.hpp"
#include "core/physics/axis_feedforward.hpp"
#include "idl/commander.h"
#include "idl/compensation.h"
#include "idl/index.h"
#include "idl/sensing.h"
#include "idl/stage.h"

namespace invar::stage {

/// Reads feedback, follows the trajectory of the last command with a PID or cascade law and feedforward, and writes the
/// motor's current. The servo works on the corrected setpoint (setpoint plus the compensation's correction). A model.yaml of
/// the axis, as `invar diagnose` writes it, may be loaded, also while running. Then its forces, with those of its terms, are
/// fed forward, and the errors of its encoder terms are taken out of the reading.
///
/// Safe value: motor not enabled. If feedback or a fused position is stale or no number, the axis brakes on feedforward. If a
/// correction stays away, it brakes. Then the drive is disabled or the axis holds (`on_lost_input`). A limit switch that closes
/// brakes the axis, and only moves away from the switch are taken. If the commander is lost, the axis brakes and stands. Following error and a fault of the drive trip it at once. A
/// notice gives the reason. Before it is disabled or deactivated the axis brakes; if it still moves then, a notice states its
/// speed.
class Stage final : public Component, public Redundant {
 public:
  struct Control {
    std::string kind = "pid";
    double kp = 4.0e4;
    double ki = 4.0e5;
    double kd = 300.0;
    double kv = 0.0;
    double velocity_filter = 300.0;
    double limit = 10.0;
    double feedforward_velocity = 0.0;
    double feedforward_acceleration = 0.0;
    void describe(auto& p) {
      p(kind, "kind", "pid or cascade, the laws of model.yaml");
      p(kp, "kp", "1", Range{0.0, 1e9}, "proportional gain: A/m, in a cascade 1/s");
      p(ki, "ki", "A/(m s)", Range{0.0, 1e10}, "integral gain");
      p(kd, "kd", "A s/m", Range{0.0, 1e7}, "derivative gain");
      p(kv, "kv", "A s/m", Range{0.0, 1e7}, "velocity gain of a cascade");
      p(velocity_filter, "velocity_filter", "Hz", Range{1.0, 1e5}, "corner of the velocity's low-pass");
      p(limit, "limit", "A", Range{1e-3, 1e3}, "highest current");
      p(feedforward_velocity, "feedforward_velocity", "A s/m", Range{0.0, 1e5}, "damping over motor constant",
        while_running);
      p(feedforward_acceleration, "feedforward_acceleration", "A s2/m", Range{0.0, 1e5},
        "mass over motor constant", while_running);
      if constexpr (requires { p.node(); })
        if (kind != "pid" && kind != "cascade")
          p.node()["kind"].fault("`" + kind + "` is no law", "use pid or cascade");
    }
  };
  struct Limits {
    double velocity = 0.1;
    double acceleration = 2.0;
    double jerk = 60.0;
    void describe(auto& p) {
      p(velocity, "velocity", "m/s", Range{1e-6, 10.0}, "highest velocity");
      p(acceleration, "acceleration", "m/s2", Range{1e-4, 200.0}, "highest acceleration");
      p(jerk, "jerk", "m/s3", Range{1e-2, 1e5}, "highest jerk");
    }
  };
  struct Parameters {
    std::int64_t axis = 0;
    Range travel{0.0, 0.2};
    Control control;
    Limits limits;
    std::filesystem::path model;
    double homing_velocity = 0.01;
    HomingParameters homing;
    bool absolute_encoder = true;
    double following_error = 1e-3;
    double settle_window = 1e-6;
    double settle_time = 0.02;
    double feedback_timeout = 0.002;
    std::string on_lost_input = "off";
    std::string lost_commander = "stop";
    double commander_timeout = 0.08;
    void describe(auto& p) {
      p(axis, "axis", 0, 2, "0, 1, 2 for x, y, z");
      p(travel, "travel", "m", "soft limits");
      p(control, "control", "control law");
      p(limits, "limits", "limits of the trajectories");
      p(model, "model",
        "model.yaml of plant axis: its forces are fed forward in place of feedforward_velocity and "
        "_acceleration");
      p(homing_velocity, "homing_velocity", "m/s", Range{1e-5, 1.0}, "towards the home");
      p(homing, "homing", "how the command `home` finds the zero");
      p(absolute_encoder, "absolute_encoder", "homed from the start");
      p(following_error, "following_error", "m", Range{1e-7, 1.0}, "trip above it", while_running);
      p(settle_window, "settle_window", "m", Range{1e-9, 1e-2}, "settled: following error inside",
        while_running);
      p(settle_time, "settle_time", "s", Range{0.0, 10.0}, "... for so long", while_running);
      p(feedback_timeout, "feedback_timeout", "s", Range{1e-4, 1.0},
        "older feedback, or two periods of a slower fused position or correction: controlled stop");
      p(on_lost_input, "on_lost_input",
        "then off (the drive is disabled) or hold (on, standing; goes on where the input comes back)");
      p(lost_commander, "lost_commander",
        "stop (under control, then stands) or finish the motion, where its commander is lost");
      p(commander_timeout, "commander_timeout", "s", Range{0.03, 10.0},
        "lost: a commander on another PC that is silent for so long, or one on this PC that has ended; it "
        "shows life "
        "every 10 ms");
      if constexpr (requires { p.node(); }) {
        if (on_lost_input != "off" && on_lost_input != "hold")
          p.node()["on_lost_input"].fault("`" + on_lost_input + "` is neither", "use off or hold");
        if (lost_commander != "stop" && lost_commander != "finish")
          p.node()["lost_commander"].fault("`" + lost_commander + "` is neither", "use stop or finish");
      }
    }
  };

  explicit Stage(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override;
  /// A loop that is unstable at this rate, by the inertia that it is fed forward or that its model states.
  [[nodiscard]] std::optional<Unfit> unfit(double period) const override;
  /// False where nobody says what the motor moves, so that `unfit` cannot know. Set-up.
  [[nodiscard]] bool gains_can_be_checked() const { return inertia().has_value(); }
  /// Soft limits [m].
  [[nodiscard]] Range travel() const { return parameters_.travel; }
  void configure() override { model_.open(parameters_.model, "diagnose the axis again"); }
  void activate() override;
  void cleanup() noexcept override { model_.close(); }
  void deactivate() noexcept override;
  bool wind_down() noexcept override;
  void step(const Tick& tick) noexcept override;
  [[nodiscard]] Standby& standby() noexcept override { return standby_; }
  template <class W>
  void warm(W& w) noexcept {
    constexpr Range currents{-1e4, 1e4}, ways{-1e2, 1e2};
    w(mode_, "mode", AXIS_MODE_FAULT);
    w(homed_, "homed");
    w(offset_, "offset", ways);
    w(trajectory_start_, "trajectory_start");
    trajectory_.warm(w);
    w(following_error_, "following_error", ways);
    w(in_vain_, "in_vain");
    w(disabling_, "disabling");
    w(correction_held_, "correction_held", ways);
    w(current_, "current", currents);
    w(standing_current_, "standing_current", currents);
    w(fed_forward_.last, "fed_forward.last", currents);
    w(fed_forward_.rest, "fed_forward.rest", currents);
    w(reading_error_.last, "reading_error.last", ways);
    w(reading_error_.rest, "reading_error.rest", ways);
    std::uint64_t command = sample_.command_id();
    bool done = sample_.command_done(), refused = sample_.command_refused();
    w(command, "command");
    w(done, "command_done");
    w(refused, "command_refused");
    if (!w.loads()) return;
    sample_.command_id(command);
    sample_.command_done(done);
    sample_.command_refused(refused);
  }

 private:
  [[nodiscard]] bool leads(const Tick& tick, bool seeing) noexcept;
  void stand_by(const Tick& tick, bool seeing) noexcept;
  void go_on_for_other(const Tick& tick) noexcept;
  using Staged = StagedModel<physics::AxisFeedforward>;
  /// A number whose source may change: the step that would give fades away.
  struct Faded {
    double last = 0.0, rest = 0.0;
    double operator()(double value, bool changed, double period) noexcept;
  };

  struct Inertia {
    double mass = 0.0;     // over motor constant [A s2/m]
    double damping = 0.0;  // likewise [A s/m]
  };
  [[nodiscard]] std::optional<Inertia> inertia() const;
  [[nodiscard]] physics::AxisControllerSettings controller_settings(double period) const;
  [[nodiscard]] std::string load(const std::filesystem::path& file, Staged::Model& model) const;
  void read_position(const AxisFeedback& feedback, const Tick& tick) noexcept;
  void obey(const AxisCommand& command, const Tick& tick) noexcept;
  [[nodiscard]] const char* why_not(const AxisCommand& command) const noexcept;
  void refuse(const AxisCommand& command, const char* why, const Tick& tick) noexcept;
  [[nodiscard]] bool start_sine(const AxisCommand& command, const Tick& tick) noexcept;
  [[nodiscard]] bool start_move(const AxisCommand& command, const Tick& tick) noexcept;
  [[nodiscard]] bool start_homing(const Tick& tick) noexcept;
  void carry_out(const Homing::Order& order, const Tick& tick) noexcept;
  [[nodiscard]] Homing::Sensed sensed(const Tick& tick) noexcept;
  [[nodiscard]] double highest_current() const noexcept;
  [[nodiscard]] bool has_arrived(const Tick& tick) const noexcept;
  void begin(const Trajectory& trajectory, const Tick& tick, AxisMode mode) noexcept;
  void begin_control(const Tick& tick) noexcept;
  [[nodiscard]] double control(const MotionPoint& setpoint, const Tick& tick) noexcept;
  void prime(const Tick& tick) noexcept;
  void brake(const MotionPoint& from, const Tick& tick) noexcept;
  void trip(const char* why) noexcept;
  [[nodiscard]] const char* unusable(const AxisFeedback& feedback) noexcept;
  void stop_blindly(const char* why, const Tick& tick) noexcept;
  void see_again(const AxisFeedback& feedback, const Tick& tick) noexcept;
  void look_for_correction(const Tick& tick) noexcept;
  void look_for_commander(const Tick& tick) noexcept;
  void stop_at_limit(const AxisFeedback& feedback, const Tick& tick) noexcept;
  void supervise(const Tick& tick) noexcept;
  void track_settling(const Tick& tick, const MotionPoint& setpoint) noexcept;
  void publish(const MotionPoint& setpoint) noexcept;
  [[nodiscard]] bool moves() const noexcept;
  [[nodiscard]] MotionPoint setpoint(const Tick& tick) const noexcept;
  [[nodiscard]] double time_along(double begin, double most, double place) const noexcept;
  void rejoin_after_stall(const Tick& tick, bool fresh) noexcept;
  [[nodiscard]] double feedforward(const Tick& tick) noexcept;

  const Parameters& parameters_;
  Input<AxisFeedback> feedback_{*this, "feedback"};
  Input<sensing::FusedPosition> fused_{*this, "fused", {.optional = true}};
  Input<compensation::AxisCorrection> correction_{*this, "correction", {.optional = true}};
  Input<commander::Link> commander_{*this, "commander", {.optional = true}};
  Input<IndexPulse> index_{*this, "index", {.optional = true}};
  Inbox<AxisCommand> command_{*this, "command"};
  Output<MotorCommand> motor_{*this, "motor"};
  Output<AxisState> state_{*this, "state"};
  Notices notices_{*this};
  Standby standby_{*this, notices_};
  struct Unanswered {
    AxisCommand command;
    Instant at;
  };
  std::array<Unanswered, 4> unanswered_{};  // the latest commands that came while it stood by
  std::size_t unanswered_next_ = 0;
  Staged model_;
  Faded fed_forward_, reading_error_;
  bool model_changed_ = false;

  physics::AxisController controller_{{}};
  Instant controlled_at_;  // its last step
  Trajectory trajectory_ = Trajectory::rest(0.0);
  Instant trajectory_start_;
  std::optional<Instant> last_step_;
  AxisMode mode_ = AXIS_MODE_DISABLED;
  AxisState sample_;     // what was published last; answers to commands are kept in it
  bool primed_ = false;  // the controller knows the loop's rate
  bool homed_ = false;
  bool blind_ = false;  // feedback is lost: braking on feedforward alone
  const char* blind_because_ = "";
  Homing homing_;
  InputWatch fused_watch_, correction_watch_;
  bool without_correction_ = false;  // it came, and stays away now
  bool without_commander_ = false;   // it is silent, and the axis moved
  bool in_vain_ = false;             // the stop under way ends the command as refused
  double standing_current_ = 0.0;    // of the controller, while it holds
  bool leaving_ = false;             // to be deactivated: it brakes and takes no commands
  bool disabling_ = false;           // told to disable the drive: it brakes first
  std::optional<Instant> seen_;      // when feedback that is usable came last
  double offset_ = 0.0;              // what homing adds to the encoder's reading
  double position_ = 0.0;
  double correction_held_ = 0.0;
  double current_ = 0.0;
  double following_error_ = 0.0;
  bool settled_ = false;
  std::uint64_t received_ = 0;             // samples of feedback so far
  const char* refused_because_ = nullptr;  // as told last
  Instant refused_at_;
  Instant outside_at_;  // when the following error was last outside the settling window
};

}  // namespace invar::stage
