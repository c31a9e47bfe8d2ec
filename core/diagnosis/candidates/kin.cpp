#include "core/diagnosis/candidates/kin.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// The power of the variable: 1, 2, 3; 0: none.
int power_of(std::string_view name) {
  if (name == "linear" || name == "coupling") return 1;
  return name == "quadratic" ? 2 : name == "cubic" ? 3 : 0;
}

}  // namespace

std::vector<physics::Model> other_laws(const Case& data, const physics::Model& model, std::size_t term,
                                       const std::set<std::string, std::less<>>& without) {
  std::vector<physics::Model> others;
  const auto& found = model.terms[term];
  const auto name = found.info->name;
  if (found.info->plant == physics::Plant::equations &&
      (name == "lag" || name == "delay" || name == "hidden_state")) {
    const double time = found.values[found.info->index_of(name == "delay" ? "delay" : "time_constant")];
    std::vector<std::string> places{found.on};
    for (const auto& input : model.equations.inputs)
      if (input.symbol != found.on) places.push_back(input.symbol);
    for (const auto& place : places)
      for (const char* other : {"lag", "delay"}) {
        if ((name == other && place == found.on) || without.contains(other)) continue;
        auto& put = others.emplace_back(model).terms[term];
        put = {};
        put.info = physics::find_term(physics::Plant::equations, other);
        put.on = place;
        put.values[0] = time;
        put.given[0] = true;
      }
    return others;
  }
  // Friction of three numbers may hold the one that is right where a fit from nothing would not begin: at nearly one speed
  // damping has taken all of it, and more. And what falls with the speed begins at a law that does not: from a carriage
  // without friction a fit does not see the small excess at rest.
  if (found.info->plant == physics::Plant::axis && found.info->is_friction) {
    double rms = 0.0, rows = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (const double v : variable_values(data, r, "velocity")) rms += v * v, rows += 1.0;
    const double usual = std::sqrt(rms / std::max(1.0, rows));
    double level = found.values[0];
    if (name == "stribeck_friction") {
      const double speeds = usual / found.values[2];
      level += (found.values[1] - level) * std::exp(-speeds * speeds);
    }
    const auto put = [&](const char* instead) -> physics::Term& {
      auto& other = others.emplace_back(model).terms[term];
      other = {};
      other.info = physics::find_term(physics::Plant::axis, instead);
      other.given.fill(true);
      return other;
    };
    if (name != "coulomb_friction" && !without.contains("coulomb_friction"))
      put("coulomb_friction").values[0] = level;
    if (name != "stribeck_friction" && !without.contains("stribeck_friction"))
      for (const double share : {0.1, 0.4}) {
        auto& other = put("stribeck_friction");
        other.values[0] = 0.8 * level, other.values[1] = 1.4 * level;
        other.values[2] = other.info->parameters[2].bounds.clamp(share * usual);
      }
    return others;
  }
  // A steady rate against a motion that goes one way is the friction of that way.
  if (found.info->plant == physics::Plant::equations && name == "constant") {
    const auto& states = model.equations.states;
    if (std::none_of(states.begin(), states.end(), [&](const auto& state) { return state.name == found.on; }))
      return others;
    const auto [low, high] = span_of(data, model, found.on);
    const double back = std::min(high, -low), forth = std::max(high, -low);
    const double level = high > -low ? -found.values[0] : found.values[0];
    if (level > 0.0 && back < 0.2 * forth && !without.contains("dry_friction")) {
      auto& put = others.emplace_back(model).terms[term];
      put = {};
      put.info = physics::find_term(physics::Plant::equations, "dry_friction");
      put.on = found.on;
      put.values[0] = level;
      put.given[0] = true;
    }
    return others;
  }
  const int power = found.info->plant == physics::Plant::equations ? power_of(name) : 0;
  if (power == 0) return others;
  // First harmonic of sign(s) |s|^p under s = sin: what a swing feels of each power.
  constexpr std::array harmonic{0.0, 1.0, 0.8488, 0.75};
  const auto& over = found.with.empty() ? found.on : found.with;
  const double swing =
      0.525 * inner_span_of(data, model, over);  // of a sine whose middle four fifths are so wide
  if (!(swing > 0.0)) return others;
  for (const char* instead : {found.with.empty() ? "linear" : "coupling", "quadratic", "cubic"}) {
    const int other = power_of(instead);
    if (other == power || without.contains(instead)) continue;
    const auto from = static_cast<std::size_t>(power), to = static_cast<std::size_t>(other);
    for (const double larger : {1.0, 1.5}) {
      auto& put = others.emplace_back(model);
      put.terms[term].info = physics::find_term(physics::Plant::equations, instead);
      put.terms[term].values[0] *= std::pow(larger * swing, power - other) * harmonic[from] / harmonic[to];
    }
  }
  return others;
}

std::vector<Fit> fits_of_other_laws(const Case& data, const Weighing& weighing, const Fit& start,
                                    std::size_t term, const std::set<std::string, std::less<>>& without) {
  const auto others = other_laws(data, start.model, term, without);
  std::vector<Fit> fits(others.size());
  in_parallel(fits.size(), [&](std::size_t i) { fits[i] = fit(data, weighing, others[i], data.model, 4); });
  std::sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.evidence > b.evidence; });
  if (fits.size() > 2) fits.resize(2);  // the others lag behind
  in_parallel(fits.size(),
              [&](std::size_t i) { fits[i] = fit(data, weighing, fits[i].model, data.model, 8, &fits[i]); });
  return fits;
}

}  // namespace invar::diagnosis
