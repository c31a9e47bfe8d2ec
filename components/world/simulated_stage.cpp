#include "components/world/simulated_stage.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/machine/heat_growth.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric/error_motions.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "core/model/model_file.hpp"

namespace invar::world {

namespace {

constexpr double longest_period = 0.01;  // s, of the loop: sizes the history of delays

}  // namespace

/// One drive with its carriage and encoder.
struct SimulatedStage::Device {
  Device(SimulatedStage& owner, int axis_number, const Axis& axis_parameters, Range travel)
      : parameters{axis_parameters},
        axis{axis_number},
        plant{plant_of(parameters, parameters.model)},
        later{plant_of(parameters, parameters.changed.empty() ? parameters.model : parameters.changed)},
        motor{owner, "motor_" + letter(axis_number), {.optional = true}},
        feedback{owner, "feedback_" + letter(axis_number)},
        index{owner, "index_" + letter(axis_number)},
        truth{owner, "truth_" + letter(axis_number)},
        ends{axis_parameters.ends, travel} {
    motor.key = feedback.key = index.key = truth.key = static_cast<std::uint32_t>(axis_number);
  }

  static physics::AxisPlant plant_of(const Axis& axis, const std::filesystem::path& file) {
    if (file.empty())
      return {
          {.mass = axis.mass, .motor_constant = axis.motor_constant, .viscous_damping = axis.viscous_damping},
          {}};
    const auto model = model::load(file);
    if (model.plant != physics::Plant::axis)
      throw InputError{file.string(), "is of plant " + std::string{physics::name_of(model.plant)},
                       "name a model.yaml of plant axis"};
    return physics::make_axis(model, longest_period);
  }
  static std::string letter(int axis) {
    return std::string(1, metrology::axis_letters[static_cast<std::size_t>(axis)]);
  }

  const Axis& parameters;
  int axis;
  physics::AxisPlant plant, later;
  bool is_changed = false;
  Input<stage::MotorCommand> motor;
  Output<stage::AxisFeedback> feedback;
  Output<stage::IndexPulse> index;
  Output<sensing::AxisReading> truth;
  AxisEnds ends;

  [[nodiscard]] double zero() const { return parameters.ends.incremental ? parameters.start : 0.0; }
  void tell_index(const stage::AxisFeedback& of) {
    if (!ends.has_index()) return;
    stage::IndexPulse pulse;
    pulse.cell(of.cell());
    pulse.axis(of.axis());
    pulse.at() = of.at();
    pulse.count(ends.pulses());
    pulse.position(ends.pulse_at() - zero());
    index.write(pulse);
  }
};

SimulatedStage::SimulatedStage(const Parameters& parameters)
    : parameters_{parameters}, random_{static_cast<std::uint64_t>(parameters.seed)} {
  if (parameters.machine.empty()) throw InputError{"machine", "missing", "name a machine.yaml"};
  machine_ = machine::load_machine(parameters.machine, 1);
  if (!machine_.errors) machine_.errors.emplace();
  directions_ = metrology::axis_directions(machine_.chain, machine_.errors->squareness);
  const Axis* axes[] = {&parameters.x, &parameters.y, &parameters.z};
  for (int axis = 0; axis < metrology::axis_count; ++axis)
    if (machine_.chain.has(axis))
      devices_.push_back(std::make_unique<Device>(*this, axis, *axes[axis],
                                                  machine_.travel[static_cast<std::size_t>(axis)]));
}

SimulatedStage::~SimulatedStage() = default;

void SimulatedStage::activate() {
  last_.reset();
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  moving_.setZero();
  warm_ = false;
  // What drifts or repeats in time goes on where it was; a plant counts its time from the first start, since a double
  // cannot tell two steps apart that are counted from 1970.
  if (!began_) began_ = simulated_time ? Instant{} : now();
  for (auto& device : devices_) {
    if (device->is_changed) std::swap(device->plant, device->later);
    device->is_changed = false;
    device->plant.rest_at(device->parameters.start, (now() - *began_).in_seconds());
    device->ends.reset(device->parameters.start);
  }
}

/// The motion goes on, the physics is another.
void SimulatedStage::change(Device& device) noexcept {
  device.later.rest_at(device.plant.position(), device.plant.time());
  device.later.set_velocity(device.plant.velocity());
  std::swap(device.plant, device.later);
  device.is_changed = true;
}

/// A machine does not stand still while its controller misses cycles: the drive holds its current, and lets go after
/// the watchdog.
void SimulatedStage::move(Device& device, const Tick& tick, int periods) const noexcept {
  const auto* command = device.motor.latest();
  for (int i = periods; i-- > 0;) {
    const Duration age = device.motor.age(tick.now) - Duration::seconds(tick.period * i);
    const bool held =
        command != nullptr && command->enabled() && age < Duration::seconds(parameters_.watchdog);
    device.plant.step(held ? command->current() : 0.0, tick.period);
    const Range stops = device.ends.stops();
    const double at = device.plant.position(), velocity = device.plant.velocity();
    if ((at < stops.lower && velocity < 0.0) || (at > stops.upper && velocity > 0.0))
      device.plant.go_on_from(std::clamp(at, stops.lower, stops.upper), 0.0);
  }
}

void SimulatedStage::step(const Tick& tick) noexcept {
  const double since = last_ ? (tick.now - *last_).in_seconds() : tick.period;
  const int periods = std::clamp(static_cast<int>(std::lround(since / tick.period)), 1, most_missed);
  last_ = tick.now;
  const auto* slide = slide_.latest();
  const auto* base = base_.latest();
  const bool known = slide != nullptr && std::isfinite(slide->temperature());
  const double temperature = known ? slide->temperature() : parameters_.temperature;
  const double lag = machine_.errors->scale_lag;
  scale_temperature_ = warm_ && lag > 0.0 ? metrology::lag_step(scale_temperature_, slide_temperature_,
                                                                temperature, tick.period, lag)
                                          : temperature;
  slide_temperature_ = temperature;
  warm_ = known;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (auto& device : devices_) {
    const auto* command = device->motor.latest();
    const bool enabled = command != nullptr && command->enabled() &&
                         device->motor.age(tick.now) < Duration::seconds(parameters_.watchdog);
    if (!device->is_changed && !device->parameters.changed.empty() &&
        device->plant.time() >= device->parameters.change_at)
      change(*device);
    device->plant.set_temperature(temperature);
    move(*device, tick, periods);

    const double velocity = device->plant.velocity();
    if (velocity != 0.0) moving_[device->axis] = velocity > 0.0 ? 1.0 : -1.0;
    device->ends.update(device->plant.position(), tick.now, tick.cycle);
    double reading = device->plant.reading() - device->zero() + device->parameters.noise * normal_(random_);
    if (const double count = device->parameters.resolution; count > 0.0)
      reading = count * std::round(reading / count);

    stage::AxisFeedback feedback;
    stamp(feedback);
    feedback.axis(static_cast<std::uint32_t>(device->axis));
    feedback.position(reading);
    feedback.velocity(velocity + device->parameters.velocity_noise * normal_(random_));
    feedback.current(device->plant.motor_current());
    feedback.drive_enabled(enabled);
    feedback.limit_low(device->ends.limit_low());
    feedback.limit_high(device->ends.limit_high());
    feedback.home_switch(device->ends.home());
    device->feedback.write(feedback);
    device->tell_index(feedback);
    sensing::AxisReading truth;
    truth.cell(cell);
    truth.sensor(static_cast<std::uint32_t>(device->axis));
    truth.at() = feedback.at();
    truth.position(device->plant.position());
    truth.velocity(velocity);
    device->truth.write(truth);
    position[device->axis] = device->plant.position();
  }
  const Eigen::Vector3d growth = machine::heat_growth(
      machine_, position, scale_temperature_,
      base != nullptr && std::isfinite(base->temperature()) ? base->temperature() : parameters_.temperature);
  const Eigen::Vector3d tool =
      position + metrology::simulated_error(machine_, directions_, position, machine_.tool, moving_, growth);
  sensing::ToolPosition sample;
  stamp(sample);
  sample.sensor(id);
  sample.position({tool.x(), tool.y(), tool.z()});
  tool_.write(sample);
}

}  // namespace invar::world
