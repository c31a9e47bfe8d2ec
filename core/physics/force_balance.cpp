#include "core/physics/force_balance.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::physics {

namespace {

double sigma_of(const Model& model, const char* name) {
  const auto* parameter = model.find(name);
  return parameter != nullptr ? parameter->sigma.value_or(0.0) : 0.0;
}

}  // namespace

ForceBalance::ForceBalance(const Model& model, const Settings& settings)
    : model_{model},
      mass_{model.value("mass", 1.0)},
      motor_constant_{model.value("motor_constant", 1.0)},
      mass_sigma_{sigma_of(model, "mass")},
      motor_sigma_{sigma_of(model, "motor_constant")},
      damping_sigma_{sigma_of(model, "viscous_damping")},
      settings_{settings} {
  INVAR_EXPECTS(settings.stretch > 0.0 && settings.noise > 0.0, settings.stretch, settings.noise);
}

bool ForceBalance::add(const AxisCycle& cycle, double period) noexcept {
  past_[count_++ % kept] = {cycle.position - model_.reading_error(cycle.position), cycle.current};
  const auto lead =
      std::min(kept - 2 * reach - 1, static_cast<std::size_t>(std::lround(model_.lead() / period)));
  const auto stretch = static_cast<std::size_t>(std::max(1L, std::lround(settings_.stretch / period)));
  if (count_ < 2 * reach + 1 + lead) return false;
  // The cycle `reach` ago, with the positions on both sides of it.
  const double position = back(reach).position;
  const double velocity = (back(0).position - back(2 * reach).position) / (2.0 * reach * period);
  const double current = back(reach + lead).current;
  const double direction = velocity > settings_.slowest ? 1.0 : (velocity < -settings_.slowest ? -1.0 : 0.0);
  if (direction == 0.0 || (in_stretch_ > 0 && direction != direction_)) {
    in_stretch_ = 0;
    return false;
  }
  const bool ended = in_stretch_ == stretch;
  if (ended) {
    const double n = static_cast<double>(stretch);
    missing_.position = sum_.position / n;
    missing_.velocity = sum_.velocity / n;
    missing_.acceleration = (velocity - begin_velocity_) / (n * period);
    missing_.force = mass_ * missing_.acceleration - sum_.force / n;
    missing_.motor_force = motor_constant_ * sum_.motor_force / n + missing_.force;
    missing_.sigma = std::sqrt(
        settings_.noise * settings_.noise + std::pow(mass_sigma_ * missing_.acceleration, 2) +
        std::pow(motor_sigma_ * sum_.motor_force / n, 2) + std::pow(damping_sigma_ * missing_.velocity, 2));
    in_stretch_ = 0;
  }
  if (in_stretch_ == 0) {
    begin_velocity_ = velocity;
    direction_ = direction;
    sum_ = {};
  }
  model_.follow(position);
  sum_.force += model_.force({0.0, position, velocity, current, 20.0}, direction);
  sum_.position += position;
  sum_.velocity += velocity;
  sum_.motor_force += current;
  ++in_stretch_;
  return ended;
}

double MissingForceHistory::rms(std::size_t newest) const noexcept {
  const std::size_t n = std::min(newest, count());
  double squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) squares += back(i).force * back(i).force;
  return n > 0 ? std::sqrt(squares / static_cast<double>(n)) : 0.0;
}

double MissingForceHistory::rms_over_sigma(std::size_t newest) const noexcept {
  const std::size_t n = std::min(newest, count());
  double squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) squares += std::pow(back(i).force / back(i).sigma, 2);
  return n > 0 ? std::sqrt(squares / static_cast<double>(n)) : 0.0;
}

namespace {

struct Candidate {
  std::string_view site, depends_on, unit;
  double (*of)(const MissingForce&);
};

constexpr std::array<Candidate, 5> straight{{
    {"axis.force", "direction", "N", [](const MissingForce& m) { return m.velocity > 0.0 ? 1.0 : -1.0; }},
    {"axis.force", "velocity", "N s/m", [](const MissingForce& m) { return m.velocity; }},
    {"axis.force", "nothing: it is constant", "N", [](const MissingForce&) { return 1.0; }},
    {"axis.force", "acceleration", "kg", [](const MissingForce& m) { return -m.acceleration; }},
    {"axis.actuator", "current", "times the motor's force",
     [](const MissingForce& m) { return m.motor_force; }},
}};

}  // namespace

Whereabouts MissingForceHistory::locate(std::size_t newest) const noexcept {
  const std::size_t n = std::min(newest, count());
  const double rows = static_cast<double>(n);
  double squares = 0.0, low = back(0).position, high = low;
  for (std::size_t i = 0; i < n; ++i) {
    squares += back(i).force * back(i).force;
    low = std::min(low, back(i).position);
    high = std::max(high, back(i).position);
  }
  if (!(squares > 0.0)) return {};
  // By how much each candidate's evidence beats that of a force of any kind, less its price.
  const auto merit = [&](double rest, double numbers) {
    return -0.5 * rows * std::log(std::max(rest, 1e-12 * squares) / squares) - 0.5 * numbers * std::log(rows);
  };
  // Nothing of all this: it goes over time.
  Whereabouts best{"axis.disturbance", "time", 1.0, std::sqrt(squares / rows), "N", {}, {}};
  double best_merit = 3.0, second = -1e300;
  Whereabouts runner_up;
  const auto consider = [&](const Whereabouts& one, double its_merit) {
    if (its_merit > best_merit) {
      second = best_merit, runner_up = best;
      best_merit = its_merit, best = one;
    } else if (its_merit > second) {
      second = its_merit, runner_up = one;
    }
  };
  for (const auto& candidate : straight) {
    double along = 0.0, length = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double x = candidate.of(back(i));
      along += x * back(i).force;
      length += x * x;
    }
    if (!(length > 0.0)) continue;
    const double explained = along * along / length;
    double strength = along / length;
    if (candidate.site == "axis.actuator")
      strength /= 1.0 - strength;  // of what the motor gives, not of what is needed
    consider({candidate.site, candidate.depends_on, explained / squares, strength, candidate.unit, {}, {}},
             merit(squares - explained, 1.0));
  }
  // Over position: the mean in each of some places, as many as the stretches can tell.
  constexpr std::size_t most_places = 48;
  const std::size_t places = std::min(most_places, n / 6);
  if (places > 1 && high > low) {
    std::array<double, most_places> sum{}, visits{};
    for (std::size_t i = 0; i < n; ++i) {
      const double share = (back(i).position - low) / (high - low);
      const auto place = std::min(places - 1, static_cast<std::size_t>(share * static_cast<double>(places)));
      sum[place] += back(i).force;
      visits[place] += 1.0;
    }
    double explained = 0.0, numbers = 0.0;
    for (std::size_t k = 0; k < places; ++k)
      if (visits[k] > 0.0) explained += sum[k] * sum[k] / visits[k], numbers += 1.0;
    consider({"axis.force", "position", explained / squares, std::sqrt(explained / rows), "N", {}, {}},
             merit(squares - explained, numbers));
  }
  if (best_merit - second < 3.0) best.rival_site = runner_up.site, best.rival = runner_up.depends_on;
  return best;
}

}  // namespace invar::physics
