#include "core/diagnosis/candidates/kin.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// A found term of a model, in whose place others are put.
struct Found {
  const Case& data;
  const physics::Model& model;
  std::size_t term;
  const std::set<std::string, std::less<>>& without;

  [[nodiscard]] const physics::Term& law() const { return model.terms[term]; }
};

/// Another law of the same plant; null where the user excludes it.
const physics::TermInfo* law(const Found& at, std::string_view name) {
  return at.without.contains(name) ? nullptr : physics::find_term(at.law().info->plant, name);
}

/// Another law in place of the found term; all its numbers are still zero.
physics::Term& put(const Found& at, const physics::TermInfo* law, std::vector<physics::Model>& others) {
  auto& other = others.emplace_back(at.model).terms[at.term];
  other = {};
  other.info = law;
  return other;
}

/// A lag or a delay of the same time, here and at each input.
std::vector<physics::Model> other_lags(const Found& at) {
  const auto& found = at.law();
  const auto& info = *found.info;
  const double time =
      found.values[info.has("delay") ? info.index_of("delay") : info.index_of("time_constant")];
  std::vector<std::string> places{found.on};
  for (const auto& input : at.model.equations.inputs)
    if (input.symbol != found.on) places.push_back(input.symbol);
  std::vector<physics::Model> others;
  for (const auto& place : places)
    for (const auto* late : {law(at, "lag"), law(at, "delay")}) {
      if (late == nullptr || (found.info == late && place == found.on)) continue;
      auto& other = put(at, late, others);
      other.on = place;
      other.values[0] = time;
      other.given[0] = true;
    }
  return others;
}

double usual_velocity(const Case& data) {
  double square = 0.0, rows = 0.0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (const double v : variable_values(data, r, "velocity")) square += v * v, rows += 1.0;
  return std::sqrt(square / std::max(1.0, rows));
}

/// Friction of three numbers may hold the one that is right where a fit from nothing would not begin: at nearly one speed
/// damping has taken all of it, and more. A friction that falls with the speed begins at a law that does not: from a carriage
/// without friction a fit does not see the small excess at rest.
std::vector<physics::Model> other_frictions(const Found& at) {
  const auto& found = at.law();
  const double usual = usual_velocity(at.data);
  const auto friction = physics::axis_kind(*found.info)->friction;
  const double level = friction != nullptr ? friction(usual, found.values.data()) : found.values[0];
  std::vector<physics::Model> others;
  const bool is_plain = !found.info->springs_first && !found.info->falls_with_speed;
  if (const auto* plain = law(at, "coulomb_friction"); plain != nullptr && !is_plain) {
    auto& other = put(at, plain, others);
    other.given.fill(true);
    other.values[0] = level;
  }
  const auto* falling = law(at, "stribeck_friction");
  if (found.info->falls_with_speed || falling == nullptr) return others;
  for (const double share : {0.1, 0.4}) {
    auto& other = put(at, falling, others);
    other.given.fill(true);
    other.values[0] = 0.8 * level, other.values[1] = 1.4 * level;
    other.values[2] = other.info->parameters[2].bounds.clamp(share * usual);
  }
  return others;
}

/// A steady rate against a motion that goes one way is the friction of that way.
std::vector<physics::Model> friction_of_one_way(const Found& at) {
  const auto& found = at.law();
  const auto& states = at.model.equations.states;
  std::vector<physics::Model> others;
  if (std::none_of(states.begin(), states.end(), [&](const auto& state) { return state.name == found.on; }))
    return others;
  const auto [low, high] = span_of(at.data, at.model, found.on);
  const double back = std::min(high, -low), forth = std::max(high, -low);
  const double level = high > -low ? -found.values[0] : found.values[0];
  const auto* friction = law(at, "dry_friction");
  if (!(level > 0.0 && back < 0.2 * forth) || friction == nullptr) return others;
  auto& other = put(at, friction, others);
  other.on = found.on;
  other.values[0] = level;
  other.given[0] = true;
  return others;
}

std::vector<physics::Model> other_powers(const Found& at) {
  // First harmonic of sign(s) |s|^p under s = sin: how much a swing feels of each power.
  constexpr std::array harmonic{0.0, 1.0, 0.8488, 0.75};
  const auto& found = at.law();
  const int power = found.info->power;
  const auto& over = found.with.empty() ? found.on : found.with;
  const double swing =
      0.525 * inner_span_of(at.data, at.model, over);  // of a sine whose middle four fifths are so wide
  std::vector<physics::Model> others;
  if (!(swing > 0.0)) return others;
  const auto* first = found.with.empty() ? law(at, "linear") : law(at, "coupling");
  for (const auto* instead : {first, law(at, "quadratic"), law(at, "cubic")}) {
    if (instead == nullptr || instead->power == power) continue;
    const int other = instead->power;
    const auto from = static_cast<std::size_t>(power), to = static_cast<std::size_t>(other);
    for (const double larger : {1.0, 1.5}) {
      auto& term = others.emplace_back(at.model).terms[at.term];
      term.info = instead;
      term.values[0] *= std::pow(larger * swing, power - other) * harmonic[from] / harmonic[to];
    }
  }
  return others;
}

}  // namespace

std::vector<physics::Model> other_laws(const Case& data, const physics::Model& model, std::size_t term,
                                       const std::set<std::string, std::less<>>& without) {
  const Found at{data, model, term, without};
  const auto& info = *at.law().info;
  if (info.plant == physics::Plant::axis && info.is_friction) return other_frictions(at);
  if (info.plant != physics::Plant::equations) return {};
  if (info.lateness != physics::Lateness::none) return other_lags(at);
  if (info.is_steady) return friction_of_one_way(at);
  return info.power != 0 ? other_powers(at) : std::vector<physics::Model>{};
}

std::vector<Fit> fits_of_other_laws(const Case& data, const Weighing& weighing, const Fit& start,
                                    std::size_t term, const std::set<std::string, std::less<>>& without) {
  const auto others = other_laws(data, start.model, term, without);
  std::vector<Fit> fits(others.size());
  in_parallel(fits.size(), [&](std::size_t i) {
    fits[i] = fit(data, weighing, others[i], data.model, Effort::follow(4));
  });
  std::sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.evidence > b.evidence; });
  if (fits.size() > 2) fits.resize(2);  // the others lag behind
  in_parallel(fits.size(), [&](std::size_t i) {
    fits[i] = fit(data, weighing, fits[i].model, data.model, Effort::follow(8), &fits[i]);
  });
  return fits;
}

}  // namespace invar::diagnosis
