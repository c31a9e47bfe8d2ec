#include "tests/support/mismatch/crowd.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace invar::test::mismatch {

namespace {

/// Names that look alike: to take one for another of its family is no false claim beside a crowd that holds one.
const std::vector<std::vector<std::string>> families{
    {"coulomb_friction", "stribeck_friction", "presliding_friction", "dry_friction"},
    {"force_ripple", "motor_constant_ripple", "encoder_periodic_error", "periodic_error"},
    {"transport_delay", "amplifier_lag", "measurement_delay", "delay", "lag", "latency", "sensor_lag"},
    {"additive_disturbance", "periodic_disturbance"},
    {"linear", "quadratic", "cubic", "coupling"},
    {"backlash", "hysteresis"},
    {"hidden_node", "hidden_state", "node_coupling"}};

std::vector<std::string> family_of(const std::string& name) {
  for (const auto& family : families)
    if (std::find(family.begin(), family.end(), name) != family.end()) return family;
  return {name};
}

/// The power of the difference between the outputs of two machines without noise, in units of `of`'s noise.
double power_between(const Machine& of, const std::vector<recording::Table>& one,
                     const std::vector<recording::Table>& other) {
  double power = 0.0;
  for (const auto& [column, noise] : of.noise) {
    const double squares = noise_power(noise);
    if (!(squares > 0.0)) continue;
    for (std::size_t r = 0; r < one.size(); ++r) {
      const auto &a = one[r].find(column)->values, &b = other[r].find(column)->values;
      for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        power += std::pow(a[i] - b[i], 2) / squares;
    }
  }
  return power;
}

/// Is some output of a crowd above twice the noise? Beside less than that a model is whole.
bool is_seen(const Machine& machine, const std::vector<recording::Table>& bare) {
  constexpr double beyond = 3.0;  // of the noise's power, on top of it
  for (const auto& [column, noise] : machine.noise) {
    double power = 0.0, rows = 0.0;
    for (std::size_t r = 0; r < bare.size(); ++r) {
      const auto &a = machine.quiet[r].find(column)->values, &b = bare[r].find(column)->values;
      for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        power += std::pow(a[i] - b[i], 2), rows += 1.0;
    }
    if (power > beyond * noise_power(noise) * rows) return true;
  }
  return false;
}

bool is_beyond(const recording::Table& table, const recording::Table& bare) {
  constexpr double many = 10.0;  // spans of the machine without its crowd
  for (const auto& column : table.columns) {
    const auto* like = bare.find(column.name);
    if (like == nullptr || like->values.empty()) continue;
    // What the machine says nothing of without its crowd is no measure: a crowd cannot be made small enough for it.
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double v : like->values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
    const double reach = many * std::max(high - low, std::abs(high));
    for (std::size_t i = 0; i < std::min(column.values.size(), like->values.size()); ++i)
      if (std::isfinite(like->values[i]) && !(std::abs(column.values[i] - low) <= reach)) return true;
  }
  return false;
}

}  // namespace

bool runs_away(const Machine& machine, const Machine& bare) {
  for (std::size_t r = 0; r < machine.quiet.size(); ++r)
    if (is_beyond(machine.quiet[r], bare.quiet[r])) return true;
  return is_beyond(machine.test_outputs, bare.test_outputs);
}

namespace {

/// Those of a plant that a crowd may hold: not what asks for columns of its own, and not what is like the chief.
std::vector<std::string> members(const std::string& plant, const std::string& chief) {
  const auto like = family_of(chief);
  std::vector<std::string> all;
  for (const auto& name : effects(plant)) {
    constexpr std::array needs_more{"none", "parameter", "refractive_index", "abbe_offset",
                                    "stribeck_friction"};
    if (std::find(needs_more.begin(), needs_more.end(), name) != needs_more.end()) continue;
    if (name == chief || std::find(like.begin(), like.end(), name) != like.end()) continue;
    all.push_back(name);
  }
  return all;
}

}  // namespace

Machine make_crowded(const std::string& plant, const std::string& chief, double size, unsigned seed,
                     Trouble trouble) {
  const Trouble alone = trouble;
  const auto bare = make(plant, chief, size, seed, alone);
  Trouble without = alone;
  without.muted = chief;
  Draw draw{seed + 4711U};
  // A crowd alone: each as large as a seen effect is beside others.
  constexpr double of_a_crowd = 2.0;  // times the noise of a row, all together
  double rows = 0.0;
  for (const auto& table : bare.quiet) rows += static_cast<double>(table.rows());
  const double whole = chief == "none"
                           ? of_a_crowd * of_a_crowd * rows
                           : power_between(bare, bare.quiet, make(plant, chief, size, seed, without).quiet);
  auto pool = members(plant, chief);
  const std::size_t count = std::min(pool.size(), 3 + draw.index(4));
  std::vector<std::string> unlisted;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = draw.index(pool.size());
    const std::string name = pool[at];
    pool.erase(pool.begin() + static_cast<std::ptrdiff_t>(at));
    const double share = chief == "none" ? 1.0 / static_cast<double>(count) : draw.log_between(0.005, 0.04);
    constexpr double tried = 0.2;
    Trouble one = alone;
    one.crowd = {{name, tried}};
    const double power = power_between(bare, make(plant, chief, size, seed, one).quiet, bare.quiet);
    if (!(power > 0.0)) continue;
    trouble.crowd[name] = std::min(2.0, tried * std::sqrt(share * whole / power));
    for (auto& relative : family_of(name)) unlisted.push_back(std::move(relative));
  }
  auto machine = make(plant, chief, size, seed, trouble);
  // Small effects that feed one another run away; no recording shows such a machine.
  while (runs_away(machine, bare)) {
    for (auto& [name, of_usual] : trouble.crowd) of_usual *= 0.5;
    machine = make(plant, chief, size, seed, trouble);
  }
  for (const auto& [name, of_usual] : trouble.crowd) machine.crowd.push_back(name);
  machine.unlisted = std::move(unlisted);
  // The chief effect alone can be modelled so far.
  const auto test = bare.test_outputs.columns;
  for (std::size_t c = 1; c < test.size(); ++c) {
    double squares = 0.0;
    const auto& full = machine.test_outputs.columns[c].values;
    for (std::size_t i = 0; i < full.size(); ++i)
      if (const double apart = full[i] - test[c].values[i]; std::isfinite(apart))
        squares += apart * apart / static_cast<double>(full.size());
    machine.left_by_crowd[machine.test_outputs.columns[c].name] = squares;
  }
  if (machine.missing.empty()) {
    machine.missing.push_back({{{"unmodelled", 1.0}}, {}, {}});
    for (const auto& name : machine.unlisted) machine.missing.front().names[name] = 1.0;
  }
  // A chief effect that no recording tells from its twin stays so beside a crowd.
  const double ambiguous = bare.verdicts.contains("ambiguous") ? bare.verdicts.at("ambiguous") : 0.5;
  machine.verdicts = {{"partly_explained", 1.0}, {"explained", 0.5}, {"ambiguous", ambiguous}};
  if (!is_seen(machine, bare.quiet)) {
    machine.verdicts["explained"] = 1.0;
    if (chief == "none") machine.verdicts["no_mismatch"] = 1.0;
  }
  if (machine.missing.front().names.contains("unmodelled")) machine.verdicts["unknown_physics"] = 1.0;
  return machine;
}

}  // namespace invar::test::mismatch
