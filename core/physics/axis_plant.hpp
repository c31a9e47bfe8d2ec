// AxisPlant: a linear-motor axis that steps in time, m x'' = k_f u - c x' and the physics terms it is given.
#pragma once

#include <array>
#include <vector>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/curve_memory.hpp"

namespace invar::physics {

struct AxisParameters {
  double mass = 1.0;             // [kg] all that moves
  double motor_constant = 1.0;   // [N/A], or [N/V] where the command is a voltage
  double viscous_damping = 0.0;  // [N s/m]
};

/// Meaning of the curve of an `unmodelled` force: a force [N], dry friction [N] against the motion, damping [N s/m], or moved
/// mass [kg] that comes and goes. The curve of an `unmodelled` actuator is a current [A] that is added to the command.
enum class CurveActs { as_force, as_friction, as_damping, as_mass, as_current };

/// A term with its numbers, in the order of its info.
struct AxisTerm {
  const AxisTermKind* kind = nullptr;
  std::array<double, most_parameters> parameters{};
  Curve curve{};  // only of an `unmodelled` term: a force [N] (or relative motor force) over one variable
  CurveActs acts = CurveActs::as_force;
};

/// The truth side of an axis: `world` steps one at the loop's rate, `simulate` one for each recording. The order from command
/// to reading: additive disturbance and dead zone, transport delay, amplifier lag, motor (saturation, ripple), carriage
/// (forces, dry friction, flexible mode), backlash, measurement delay, encoder error.
///
/// Integration: classical Runge-Kutta in short sub-steps between switching events. Standstill, breakaway and reversal are
/// found as events, delay and lag are exact, and bristles follow the way travelled and so are never stiff. Repeatable bit for
/// bit.
class AxisPlant {
 public:
  /// `longest_step` is the largest dt that `step` will be asked for; it sizes the history of delays. Set-up
  /// only: allocates. Preconditions: mass > 0, longest_step > 0.
  AxisPlant(const AxisParameters& parameters, std::vector<AxisTerm> terms, double longest_step = 1e-3);

  // The lists below point into terms_, which a move carries along and a copy would not.
  AxisPlant(const AxisPlant&) = delete;
  AxisPlant& operator=(const AxisPlant&) = delete;
  AxisPlant(AxisPlant&&) noexcept = default;
  AxisPlant& operator=(AxisPlant&&) noexcept = default;
  ~AxisPlant() = default;

  /// At rest at `position` [m] at `time` [s], no current, all histories empty. Real-time.
  void rest_at(double position, double time = 0.0) noexcept;
  /// Another speed to start from, after rest_at. Real-time.
  void set_velocity(double velocity) noexcept { velocity_ = velocity; }
  /// Goes on from another position and speed, as if it had come there at that speed; currents on their way, bristles, play
  /// and what swings stay as they are. Real-time.
  void go_on_from(double position, double velocity) noexcept;
  /// The temperature that terms may depend on [degC]. Real-time.
  void set_temperature(double temperature) noexcept { temperature_ = temperature; }
  /// A further force on the carriage from outside, held until changed [N]. Real-time.
  void set_outside_force(double force) noexcept { outside_force_ = force; }

  /// Advances by dt [s] while `command` [A] is held. Real-time: no allocation, no lock.
  void step(double command, double dt) noexcept;

  /// The current [A] that reaches the motor as `command` is given for a step of dt from now on: what would be measured there.
  /// Real-time.
  [[nodiscard]] double applied(double command, double dt) const noexcept;

  /// Reading of the encoder now [m], without noise and resolution. Real-time. Backlash and measurement delay
  /// have memory: call it as often as you like between steps, the answer is the same.
  [[nodiscard]] double reading() const noexcept;
  [[nodiscard]] double time() const noexcept { return time_; }

  /// For feedforward: all forces on the carriage in a motion, dry friction against `direction` (+1, -1, 0) included [N].
  [[nodiscard]] double force(const AxisPoint& at, double direction) const noexcept {
    return push(at) - direction * hold(at, direction * at.velocity);
  }
  /// For feedforward: goes to a position in no time; bristles bend on the way. Real-time.
  void follow(double position) noexcept;
  /// Excess of the encoder where the carriage stands at `position` [m], delays and backlash aside.
  [[nodiscard]] double reading_error(double position) const noexcept;
  [[nodiscard]] double position() const noexcept { return position_; }  // of the carriage, the truth
  [[nodiscard]] double velocity() const noexcept { return velocity_; }
  [[nodiscard]] double motor_current() const noexcept { return current_; }  // behind delay and lag

 private:
  struct State {
    double position, velocity;
    double swing, swing_speed;  // of the flexible part, relative to the carriage
  };
  struct Slope {
    double velocity, acceleration, swing_speed, swing_acceleration;
  };
  struct Mode {
    double share, stiffness, damping;  // of the swinging mass
  };
  /// Values at past instants, for delays.
  struct Past {
    static constexpr std::size_t size = 256;
    std::array<double, size> time{}, value{}, slope{};
    std::size_t count = 0;
    void clear() noexcept { count = 0; }
    void push(double t, double v, double s) noexcept {
      const auto at = count++ % size;
      time[at] = t, value[at] = v, slope[at] = s;
    }
  };

  /// One effect of a term, ready to be asked: its function and its numbers.
  template <class Function>
  struct Effect {
    Function function;
    const double* parameters;
  };
  using PointEffect = Effect<double (*)(const AxisPoint&, const double*)>;
  using NumberEffect = Effect<double (*)(double, const double*)>;

  [[nodiscard]] double variable(int code, const AxisPoint& at) const noexcept;
  [[nodiscard]] double push(const AxisPoint& at) const noexcept;  // all forces but dry friction and swing
  [[nodiscard]] double hold(const AxisPoint& at, double speed) const noexcept;  // dry friction
  [[nodiscard]] double motor_besides(const AxisPoint& at) const noexcept;       // of its nominal force
  [[nodiscard]] double with_terms(double force, const AxisPoint& at) const noexcept;
  [[nodiscard]] double pushed(const AxisPoint& at) const noexcept;  // push and hold for the innermost loop
  [[nodiscard]] double held(const AxisPoint& at, double speed) const noexcept;
  [[nodiscard]] Slope slope(const State& s, double time, double direction, bool stuck) const noexcept;
  [[nodiscard]] State advanced(const State& s, double h, double direction, bool stuck) const noexcept;
  [[nodiscard]] State advanced_with_mode(const State& s, double h, double direction,
                                         bool stuck) const noexcept;
  [[nodiscard]] double per_mass(const AxisPoint& at) const noexcept;  // acceleration of the carriage by force
  [[nodiscard]] double commanded(double command, double dt) const noexcept;  // before delay and lag
  void drive(double command, double dt) noexcept;  // one held command behind the delay
  void move(double h) noexcept;                    // one sub-step with current_mean_
  [[nodiscard]] double delayed_position(double age) const noexcept;

  AxisParameters parameters_;
  std::vector<AxisTerm> terms_;
  std::vector<PointEffect> forces_, motors_;
  std::vector<NumberEffect> frictions_, readings_;
  std::vector<const AxisTerm*> commands_, bristles_;
  std::vector<std::pair<const AxisTerm*, int>> force_curves_, friction_curves_, damping_curves_, mass_curves_,
      motor_curves_, reading_curves_, command_curves_;
  double per_carriage_mass_ = 0.0, per_swinging_mass_ = 0.0;  // [1/kg]
  bool has_motor_terms_ = false, has_force_terms_ = false;
  double delay_ = 0.0, lag_ = 0.0, age_ = 0.0;
  const AxisTerm* play_ = nullptr;
  Mode mode_{};
  double longest_substep_ = 1e-3;

  double time_ = 0.0, position_ = 0.0, velocity_ = 0.0, temperature_ = 20.0, outside_force_ = 0.0;
  double swing_ = 0.0, swing_speed_ = 0.0;
  double current_ = 0.0, current_mean_ = 0.0;
  double played_ = 0.0;
  double bristle_from_ = 0.0;
  std::array<double, 4> bristle_{};
  /// Force curves with memory, over the position.
  std::vector<std::pair<const AxisTerm*, CurveMemory>> remembering_;
  double remembered_at_ = 0.0;  // [s]
  Past commands_past_, positions_past_;
};

}  // namespace invar::physics
