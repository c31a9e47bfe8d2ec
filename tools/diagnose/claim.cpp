#include "tools/diagnose/claim.hpp"

#include <algorithm>
#include <cmath>

namespace invar::diagnose {

using physics::Role;
using physics::Term;

std::string label(const Term& term) {
  std::string text{term.info->name};
  if (!term.on.empty()) text += "@" + term.on;
  if (!term.with.empty()) text += "+" + term.with;
  return text;
}

namespace {

/// Rates against the motion take energy out of it; one that brings some in is no drag, however well it fits.
bool brings_energy(const physics::Model& model, const Term& term) {
  const auto name = term.info->name;
  if (!term.with.empty() || term.values[0] <= 0.0 || (name != "linear" && name != "quadratic" && name != "cubic"))
    return false;
  return std::any_of(model.equations.states.begin(), model.equations.states.end(),
                     [&](const auto& state) { return state.derivative == term.on; });
}

/// Are there rows enough for this many numbers? What a few rows leave is the curve of their scale as much as physics.
bool is_affordable(const Case& data, const Fit& fit) {
  constexpr double rows_a_number = 14.0;
  double rows = 0.0;
  for (const auto& recording : data.recordings)
    for (const auto& measured : recording.measured)
      for (double v : measured) rows += std::isfinite(v) ? 1.0 : 0.0;
  return rows >= rows_a_number * static_cast<double>(fit.free.size());
}

/// Did the recording let the term show what sets it apart?
bool acts(const Case& data, const physics::Model& model, const Term& term) {
  const auto [low, high] = span_of(data, model, term.with.empty() ? term.on : term.with);
  const double size = std::max(std::abs(low), std::abs(high));
  // What repeats must have been seen to repeat.
  if (term.info->name == "periodic") return high - low >= 2.0 * term.values[1];
  // Friction that never turned is a constant.
  if (term.info->name == "dry_friction") return low < -0.03 * size && high > 0.03 * size;
  if (!term.info->parameters[0].name.starts_with("limit")) return true;
  // A limit that one or two rows touch is an outlier.
  auto free = model;
  std::erase_if(free.terms,
                [&](const Term& t) { return t.info == term.info && t.on == term.on && t.with == term.with; });
  const auto with = simulate(data, model), without = simulate(data, free);
  std::size_t rows = 0;
  for (std::size_t r = 0; r < with.size(); ++r)
    for (std::size_t o = 0; o < with[r].size(); ++o)
      for (std::size_t i = 0; i < with[r][o].size(); ++i)
        rows += std::abs(with[r][o][i] - without[r][o][i]) > 1e-6 * std::abs(with[r][o][i]) ? 1U : 0U;
  return rows >= 5;
}

}  // namespace

bool stands(const Case& data, const Fit& fit, std::size_t term) {
  const auto& info = *fit.model.terms[term].info;
  const auto& values = fit.model.terms[term].values;
  // A shape at the end of its range is another term in disguise.
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    const auto& p = info.parameters[i];
    if (p.role == Role::amplitude && p.bounds.upper < 1e100 && std::abs(values[i]) > 0.99 * p.bounds.upper)
      return false;
    if (p.role != Role::shape || p.name == "center" || p.name == "limit") continue;
    if (p.bounds.lower > 0.0 && p.bounds.upper > 100.0 * p.bounds.lower && values[i] < 1.3 * p.bounds.lower)
      return false;
    if (p.bounds.upper < 1e100 && p.bounds.upper > 0.0 && values[i] > 0.99 * p.bounds.upper) return false;
  }
  if (data.model.plant == physics::Plant::equations &&
      (brings_energy(fit.model, fit.model.terms[term]) || !is_affordable(data, fit) ||
       !acts(data, fit.model, fit.model.terms[term])))
    return false;
  // Friction that is smaller at rest than at speed is none.
  if (info.name == "stribeck_friction" && values[1] < 1.1 * values[0]) return false;

  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    const auto& f = fit.free[k];
    if (f.where != Freedom::Where::term || f.term != term) continue;
    if (info.parameters[f.index].role != Role::amplitude) continue;
    if (std::abs(get(fit.model, f)) > 3.0 * fit.sigma(static_cast<Eigen::Index>(k))) return true;
  }
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    if (info.parameters[i].role == Role::amplitude) return false;
  return true;  // a term of shapes alone, or a curve
}

}  // namespace invar::diagnose
