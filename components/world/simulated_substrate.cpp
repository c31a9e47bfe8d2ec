#include "components/world/simulated_substrate.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/physics/terms/droplet/air_drag.hpp"
#include "core/physics/terms/droplet/crosswind.hpp"
#include "core/physics/terms/droplet/pressure_dependence.hpp"
#include "core/physics/terms/droplet/speed_decay.hpp"
#include "core/physics/terms/droplet/stage_velocity_carry.hpp"
#include "core/physics/terms/droplet/valve_delay.hpp"

namespace invar::world {

using namespace dispensing;
namespace terms = physics::droplet;

void SimulatedSubstrate::configure() { waiting_.reserve(4096); }

void SimulatedSubstrate::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  waiting_.clear();
  remembered_ = 0;
  sample_ = {};
  sample_.number(1);
  sample_.height(2e-3);
  stamp(sample_);
  sample_.component_id(id);
  begins_ = true;
}

void SimulatedSubstrate::remember(const sensing::ToolPosition& tool) noexcept {
  if (remembered_ > 0 && way_[(remembered_ - 1) % way_.size()].time_ns >= tool.at().time_ns()) return;
  if (remembered_ == 0) begun_ = {tool.at().time_ns()};
  way_[remembered_++ % way_.size()] = {tool.at().time_ns(), {tool.position()[0], tool.position()[1]}};
}

/// By the parabola through three samples around that time; false when it is not between remembered ones.
bool SimulatedSubstrate::tool_at(std::int64_t time_ns, Eigen::Vector2d& position,
                                 Eigen::Vector2d& velocity) const noexcept {
  const std::size_t oldest = remembered_ > way_.size() ? remembered_ - way_.size() : 0;
  for (std::size_t k = remembered_; k-- > oldest + 2;) {
    const Tool& c = way_[k % way_.size()];
    const Tool& b = way_[(k - 1) % way_.size()];
    const Tool& a = way_[(k - 2) % way_.size()];
    if (time_ns > c.time_ns) return false;
    if (time_ns < b.time_ns && k > oldest + 2) continue;
    const auto seconds = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-9; };
    const Eigen::Vector2d first = (b.position - a.position) / seconds(b.time_ns - a.time_ns);
    const Eigen::Vector2d second =
        ((c.position - b.position) / seconds(c.time_ns - b.time_ns) - first) / seconds(c.time_ns - a.time_ns);
    const double from_a = seconds(time_ns - a.time_ns);
    const double from_b = seconds(time_ns - b.time_ns);
    position = a.position + from_a * (first + from_b * second);
    velocity = first + (from_a + from_b) * second;
    return true;
  }
  return false;
}

void SimulatedSubstrate::land(const ValvePulse& pulse, const Eigen::Vector2d& at, double diameter,
                              double after, bool satellite) noexcept {
  LandedDroplet landed;
  stamp(landed, Instant{pulse.open_ns()} + Duration::seconds(after));
  landed.component_id(id);
  landed.substrate(sample_.number());
  landed.droplet(pulse.droplet());
  landed.satellite(satellite);
  landed.position({at.x(), at.y()});
  landed.diameter(diameter);
  landed_.write(landed);
}

void SimulatedSubstrate::fly(const ValvePulse& pulse) noexcept {
  const Parameters& p = parameters_;
  const auto* air = pressure_.latest();
  const double pressure = air != nullptr ? air->pressure() : 0.0;
  const double open = static_cast<double>(pulse.pulse_ns()) * 1e-9 - p.dead_time;
  Eigen::Vector2d position, velocity;
  if (pressure < p.least_pressure || open <= 0.0 || !tool_at(pulse.open_ns(), position, velocity)) return;

  physics::Droplet drop;
  drop.time = static_cast<double>(pulse.open_ns() - begun_.ns) * 1e-9;
  drop.height = sample_.height();
  drop.pressure = pressure;
  drop.stage_x = velocity.x();
  drop.stage_y = velocity.y();
  const auto with = [&drop]<class Term>(Term, std::array<double, 2> values) {
    Term::apply(drop, values.data());
  };
  with(terms::StageVelocityCarry{}, {p.speed});
  with(terms::ValveDelay{}, {p.delay});
  with(terms::PressureDependence{}, {p.pressure_exponent, p.nominal_pressure});
  with(terms::SpeedDecay{}, {p.speed_decay});
  with(terms::AirDrag{}, {p.drag_diameter});
  with(terms::Crosswind{}, {p.crosswind[0], p.crosswind[1]});
  const double slope = std::tan(p.tilt);
  const auto flown = physics::landing(drop, slope * std::cos(p.azimuth), slope * std::sin(p.azimuth));

  const double scatter = std::hypot(p.scatter, p.scatter_per_height * drop.height);
  Eigen::Vector2d at = position + Eigen::Vector2d{flown.x + p.placement[0], flown.y + p.placement[1]};
  for (double& coordinate : at) coordinate += scatter * normal_(random_);
  const double nominal =
      std::cbrt(open / (p.nominal_pulse - p.dead_time) * std::sqrt(pressure / p.nominal_pressure));
  const double diameter = std::max(p.diameter * nominal + p.diameter_scatter * normal_(random_), 1e-6);
  const double time = p.delay + drop.height / (drop.speed * drop.speed_factor);
  land(pulse, at, diameter, time, false);
  sample_.droplets(sample_.droplets() + 1);
  if (std::uniform_real_distribution<double>{}(random_) >= p.satellites) return;
  // A third of the size and slower: it lands behind, where the air takes it.
  const double away = diameter * (0.9 + 0.2 * std::abs(normal_(random_)));
  const double angle = 0.5 * normal_(random_);
  const Eigen::Vector2d back =
      velocity.norm() > 1e-6 ? Eigen::Vector2d{-velocity.normalized()} : Eigen::Vector2d{1.0, 0.0};
  const Eigen::Vector2d where{std::cos(angle) * back.x() - std::sin(angle) * back.y(),
                              std::sin(angle) * back.x() + std::cos(angle) * back.y()};
  land(pulse, at + away * where, 0.3 * diameter, 1.5 * time, true);
}

void SimulatedSubstrate::step(const Tick&) noexcept {
  if (const auto* tool = tool_.latest()) remember(*tool);
  bool changed = std::exchange(begins_, false);
  SubstrateCommand command;
  while (command_.take(command)) {
    sample_.command_id(command.id());
    sample_.number(sample_.number() + 1);
    sample_.height(command.height());
    sample_.droplets(0);
    changed = true;
  }
  ValvePulse pulse;
  while (pulse_.take(pulse))
    if (waiting_.size() < waiting_.capacity()) waiting_.push_back(pulse);
  const std::int64_t newest = remembered_ > 0 ? way_[(remembered_ - 1) % way_.size()].time_ns : INT64_MIN;
  std::size_t kept = 0;
  for (const ValvePulse& due : waiting_) {
    if (due.open_ns() <= newest) {
      fly(due);
      changed = true;
    } else {
      waiting_[kept++] = due;
    }
  }
  waiting_.resize(kept);
  if (!changed) return;
  stamp(sample_);
  state_.write(sample_);
}

}  // namespace invar::world
