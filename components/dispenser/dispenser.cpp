#include "components/dispenser/dispenser.hpp"

#include <charconv>
#include <cmath>
#include <utility>

#include "core/compensation/trajectory_file.hpp"

namespace invar::dispenser {

using namespace dispensing;

Dispenser::Dispenser(const Parameters& parameters) : parameters_{parameters} {
  (void)modbus::load_map_of(
      parameters.modbus.map, "modbus.map", "pneumatic controller",
      {"pressure", "purge_pressure", "band", "enable", "purge", "reset_alarms", "actual_pressure",
       "actual_purge_pressure", "in_band", "supply_low", "over_pressure", "sensor_fault", "comm_lost"});
  for (const Pattern& pattern : parameters.patterns) patterns_[pattern.name] = targets(pattern);
  if (patterns_.size() != parameters.patterns.size())
    throw InputError{"patterns", "two have one name", "rename one of them"};
  if (!parameters.model.empty()) active_ = load(parameters.model);
}

void Dispenser::configure() { client_.open(parameters_.modbus, simulated_time); }

void Dispenser::cleanup() noexcept { client_.close(); }

void Dispenser::activate() {
  setpoint_ = parameters_.pressure;
  purge_setpoint_ = parameters_.purge_pressure;
  wanted_ = parameters_.pressurise;
  purge_ = latched_ = false;
  reset_at_ = Instant{} - Duration::seconds(1.0);
}

void Dispenser::deactivate() noexcept {
  if (!client_.is_open()) return;
  wanted_ = purge_ = false;
  drive(false);
  client_.send(now());
}

bool Dispenser::flag(const char* reg) const {
  const modbus::Reading reading = client_.device().value(reg);
  return !reading.stale && reading.value != 0.0;
}

void Dispenser::drive(bool enable) noexcept {
  // Out of the map's range cannot be: parameters and commands were checked.
  (void)client_.device().write("pressure", setpoint_);
  (void)client_.device().write("purge_pressure", purge_setpoint_);
  (void)client_.device().write("band", parameters_.band);
  (void)client_.device().write("purge", enable && purge_ ? 1.0 : 0.0);
  (void)client_.device().write("enable", enable ? 1.0 : 0.0);
}

void Dispenser::obey(const PressureCommand& command) noexcept {
  constexpr Range sound{1.0, 7e5};
  if (sound.contains(command.setpoint())) setpoint_ = command.setpoint();
  if (sound.contains(command.purge_setpoint())) purge_setpoint_ = command.purge_setpoint();
  wanted_ = command.enabled();
  purge_ = command.purge();
  if (!command.reset_alarms()) return;
  latched_ = false;
  reset_at_ = now();
  (void)client_.device().write("reset_alarms", 1.0);
}

Dispenser::Model Dispenser::load(const std::filesystem::path& file) const {
  Model model;
  model.trajectory = compensation::load_trajectory(file);
  const auto& path = *model.trajectory;
  for (const double height : {path.least_height, path.most_height})
    if (!(path.offset(height).norm() <= parameters_.bound))
      throw InputError{
          file.string(),
          "moves targets by more than the bound of " + std::to_string(parameters_.bound * 1e6) + " um",
          "look at the head before raising `bound`"};
  const std::string seal = config::Yaml::load(file).root().text("checksum");
  (void)std::from_chars(seal.data(), seal.data() + seal.size(), model.checksum, 16);
  return model;
}

void Dispenser::obey(const compensation::ModelCommand& command) {
  compensation::ModelStatus reply;
  stamp(reply);
  reply.component_id(id);
  reply.command_id(command.id());
  reply.path(command.path());
  const Model* about = &active_;
  switch (command.kind()) {
    case compensation::MODEL_STAGE:
      try {
        staged_ = load(command.path().c_str());
        about = &staged_;
        reply.state(compensation::MODEL_STAGED);
      } catch (const std::exception& error) {
        about = nullptr;
        reply.state(compensation::MODEL_REFUSED);
        reply.text(error.what());
      }
      break;
    case compensation::MODEL_ACTIVATE:
      if (!staged_.trajectory) {
        about = nullptr;
        reply.state(compensation::MODEL_REFUSED);
        reply.text("nothing is staged; stage a model first");
        break;
      }
      previous_ = std::exchange(active_, std::exchange(staged_, {}));
      reply.state(compensation::MODEL_ACTIVE);
      break;
    default:  // roll back
      active_ = std::exchange(previous_, {});
      reply.state(active_.trajectory ? compensation::MODEL_ACTIVE : compensation::MODEL_NONE);
  }
  if (about != nullptr) reply.model_checksum(about->checksum);
  status_.write(reply);
}

/// Why there are no points; empty: there are.
std::string Dispenser::fill(const PatternCommand& command, TriggerPattern& pattern) const {
  const auto found = patterns_.find(command.name().c_str());
  if (found == patterns_.end())
    return "`" + std::string{command.name().c_str()} + "` is no pattern of this dispenser";
  const double height = command.height();
  if (!(height > 0.0)) return "the height is not positive";
  metrology::DropletTrajectory path;
  if (active_.trajectory) {
    path = *active_.trajectory;
    if (!(path.sigma(height) <= parameters_.largest_sigma))
      return "the model is not certain enough at this height; calibrate there";
    if (!(path.offset(height).norm() <= parameters_.bound))
      return "the model moves targets beyond its bound at this height; calibrate there";
  }
  const Eigen::Vector2d offset = path.offset(height);
  const std::int64_t lead_ns = Duration::seconds(path.lead(height)).ns;
  for (const Eigen::Vector2d& target : found->second) {
    TriggerPoint point;
    point.target({target.x(), target.y(), 0.0});
    point.position({target.x() - offset.x(), target.y() - offset.y(), height});
    point.lead_ns(lead_ns);
    pattern.points().push_back(point);
  }
  return {};
}

void Dispenser::answer(const PatternCommand& command) {
  TriggerPattern pattern;
  stamp(pattern);
  pattern.component_id(id);
  pattern.id(command.id());
  pattern.model_checksum(active_.checksum);
  pattern.refusal(fill(command, pattern));
  for (TriggerPoint& point : pattern.points()) point.droplet(next_droplet_++);
  pattern_.write(pattern);
}

void Dispenser::publish() noexcept {
  const modbus::Reading actual = client_.device().value("actual_pressure");
  const modbus::Reading enabled = client_.device().value("enable");
  PressureState state;
  stamp(state);
  state.node(id);
  state.pressure(actual.value);
  state.setpoint(setpoint_);
  state.purge_pressure(client_.device().value("actual_purge_pressure").value);
  state.enabled(flag("enable"));
  state.purging(flag("purge"));
  state.supply_low(flag("supply_low"));
  state.over_pressure(latched_ || flag("over_pressure"));
  state.sensor_fault(flag("sensor_fault"));
  state.comm_lost(flag("comm_lost"));
  state.stale(actual.stale || enabled.stale);
  // Both must find it there: the controller may still hold the band of an older setpoint.
  state.in_band(!state.stale() && flag("in_band") && !state.supply_low() &&
                std::abs(actual.value - setpoint_) <= parameters_.band);
  pressure_.write(state);
}

void Dispenser::step(const Tick& tick) noexcept {
  PressureCommand command;
  while (command_.take(command)) obey(command);
  compensation::ModelCommand model;
  while (model_.take(model)) obey(model);
  PatternCommand pattern;
  while (wanted_pattern_.take(pattern)) answer(pattern);

  client_.receive(tick.now);
  client_.device().refresh();
  // A reset takes a few polls to show; the controller itself stays shut until it has accepted it.
  constexpr Duration grace = Duration::milliseconds(500);
  if ((flag("over_pressure") || flag("sensor_fault")) && tick.now - reset_at_ > grace) latched_ = true;
  drive(wanted_ && !latched_);
  client_.send(tick.now);
  publish();
}

}  // namespace invar::dispenser
