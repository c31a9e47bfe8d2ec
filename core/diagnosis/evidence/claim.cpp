#include "core/diagnosis/evidence/claim.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/diagnosis/evidence/waves.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

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
  if (!term.with.empty() || term.values[0] <= 0.0 || term.info->power == 0) return false;
  return std::any_of(model.equations.states.begin(), model.equations.states.end(),
                     [&](const auto& state) { return state.derivative == term.on; });
}

/// Does a further term do nothing but change a number that the user knows exactly? A steady rate beside a known gravity, once
/// there is drag. The only one that explains the recording is said: what is new then is not the number.
bool is_known_better(const Case& data, const Fit& fit, std::size_t term) {
  if (fit.model.terms.size() == data.model.terms.size() + 1) return false;
  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    if (fit.free[k].where != Freedom::Where::term || fit.free[k].term != term) continue;
    if (fit.columns.cols() != static_cast<Eigen::Index>(fit.free.size()) ||
        fit.model.terms[term].info->parameter_count() != 1)
      return false;
    const auto finite = [](double v) { return std::isfinite(v) ? v : 0.0; };
    const Eigen::VectorXd own = fit.columns.col(static_cast<Eigen::Index>(k)).unaryExpr(finite);
    for (std::size_t p = 0; p < data.model.parameters.size(); ++p) {
      const auto& parameter = data.model.parameters[p];
      if (!parameter.sigma || *parameter.sigma != 0.0 || parameter.value == 0.0) continue;
      Freedom known;
      known.index = p, known.scale = std::abs(parameter.value);
      const Eigen::VectorXd other = sensitivities(data, fit.model, {known}).col(0).unaryExpr(finite);
      if (std::abs(own.dot(other)) > 0.9999 * own.norm() * other.norm()) return other.norm() > 0.0;
    }
  }
  return false;
}

/// Did the recording let the term show what sets it apart?
bool acts(const Case& data, const physics::Model& model, const Term& term) {
  const std::string& over = physics::goes_over(term);
  const auto [low, high] = span_of(data, model, over);
  const double size = std::max(std::abs(low), std::abs(high));
  // What repeats must have been seen to repeat, and not by a few rows: half a wave is any bent law. Time goes on steadily.
  if (term.info->is_wave())
    return (over == "t" ? high - low : inner_span_of(data, model, over)) >=
           thresholds::waves_seen * term.values[1];
  // Friction that never turned nor held is a constant.
  if (term.info->is_friction && term.with == term.on) return turns(data, model, term.on);
  if (term.info->is_friction)
    return (low < -thresholds::goes_both_ways * size && high > thresholds::goes_both_ways * size) ||
           rests(data, model, over);
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
  return rows >= thresholds::rows_at_a_limit;
}

/// Was what repeats seen to repeat? Less than two waves are any bent course. Of an axis one and a half will do: there a free
/// course over the position is tried in its place.
bool repeats(const Case& data, const Term& term) {
  const auto pitch = term.info->index_of("pitch"), frequency = term.info->index_of("frequency");
  if (term.info->index_of("phase") == physics::most_parameters) return true;
  const bool in_place = pitch < physics::most_parameters;
  if (!in_place && frequency == physics::most_parameters) return true;
  std::vector<double> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto* name = !in_place                                    ? "time"
                       : data.model.plant == physics::Plant::sensor ? "true_position"
                                                                    : "position";
    const auto values = variable_values(data, r, name);
    all.insert(all.end(), values.begin(), values.end());
  }
  if (all.empty()) return true;
  std::sort(all.begin(), all.end());
  const double span = all[all.size() - 1 - all.size() / 200] - all[all.size() / 200];
  const double least = in_place && data.model.plant == physics::Plant::axis ? thresholds::waves_seen_on_axis
                                                                            : thresholds::waves_seen;
  return span * (in_place ? 1.0 / term.values[pitch] : term.values[frequency]) >= least;
}

/// Does the error of a map turn with the direction of approach, as play says? A constant error does not, however much a
/// play explains of it where nearly all points were approached from one side.
bool turns_with_direction(const Case& data, const physics::Model& model, std::size_t term) {
  const auto& play = model.terms[term];
  if (play.info->plant != physics::Plant::error_map || !play.info->sticks_and_slips) return true;
  const auto without = simulate(data, physics::without_term(model, term));
  std::array<double, 2> sum{}, square{}, rows{};
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto direction = variable_values(data, r, "direction");
    for (std::size_t i = 0; i < direction.size(); ++i)
      if (const double e = data.recordings[r].measured[0][i] - without[r][0][i];
          std::isfinite(e) && direction[i] != 0.0) {
        const std::size_t side = direction[i] > 0.0 ? 1 : 0;
        sum[side] += e, square[side] += e * e, rows[side] += 1.0;
      }
  }
  if (rows[0] < 2.0 || rows[1] < 2.0) return false;
  double difference = 0.0, variance = 0.0;
  for (const std::size_t side : {0U, 1U}) {
    const double mean = sum[side] / rows[side];
    difference += side == 1 ? mean : -mean;
    variance += (square[side] / rows[side] - mean * mean) / (rows[side] - 1.0);
  }
  return difference / play.values[0] > thresholds::play_turns &&
         std::abs(difference) > thresholds::sure_sigmas * std::sqrt(variance);
}

/// A store in equations, that is beside a signal or a state.
bool is_store(const Term& term) {
  return term.info->plant == physics::Plant::equations && term.info->lateness == physics::Lateness::store;
}

/// A store through which the whole of a signal goes is a lag: what makes it a store, the part that passes it by, is zero.
bool is_lag(const Fit& fit, std::size_t term) {
  const auto& store = fit.model.terms[term];
  const auto& states = fit.model.equations.states;
  if (!is_store(store) ||
      std::any_of(states.begin(), states.end(), [&](const auto& state) { return state.name == store.on; }))
    return false;
  double sigma = 0.0;
  for (std::size_t k = 0; k < fit.free.size(); ++k)
    if (const auto& f = fit.free[k]; f.where == Freedom::Where::term && f.term == term && f.index == 0)
      sigma = fit.sigma(static_cast<Eigen::Index>(k));
  return store.values[0] > 1.0 - std::max(thresholds::whole_store, thresholds::sure_sigmas * sigma);
}

/// A store behind a state that fills so slowly that the recording cannot tell it from one that never does: that is a rate
/// in proportion and a steady one.
bool never_fills(const Case& data, const Fit& fit, std::size_t term) {
  const auto& store = fit.model.terms[term];
  if (!is_store(store)) return false;
  if (!(store.values[1] > longest(data))) return false;
  for (std::size_t k = 0; k < fit.free.size(); ++k)
    if (const auto& f = fit.free[k]; f.where == Freedom::Where::term && f.term == term && f.index == 1)
      return store.values[1] < thresholds::sure_sigmas *
                                   fit.sigma(static_cast<Eigen::Index>(k));  // 1 / time constant: 0 +- sigma
  return false;
}

}  // namespace

bool is_affordable(const Case& data, const Fit& fit) {
  double rows = 0.0;
  for (const auto& recording : data.recordings)
    for (const auto& measured : recording.measured)
      for (double v : measured) rows += std::isfinite(v) ? 1.0 : 0.0;
  return rows >= thresholds::rows_a_number * static_cast<double>(fit.free.size());
}

bool stands(const Case& data, const Fit& fit, std::size_t term) {
  const auto& info = *fit.model.terms[term].info;
  const auto& values = fit.model.terms[term].values;
  // A shape at the end of its range is another term in disguise.
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    auto p = info.parameters[i];
    p.bounds = physics::bounds_of_parameter(data.model, fit.model.terms[term], i);
    if (p.role == Role::amplitude && p.bounds.upper < 1e100 &&
        std::abs(values[i]) > thresholds::at_upper_bound * p.bounds.upper)
      return false;
    if (p.role != Role::shape || p.name == "center" || p.name == "limit" || p.name == "squareness") continue;
    if (p.name == "damping_ratio" && values[i] < thresholds::rings_long)
      continue;  // what rings for long is a mode all the same
    if (p.bounds.lower > 0.0 && p.bounds.upper > 100.0 * p.bounds.lower &&
        values[i] < thresholds::at_lower_bound * p.bounds.lower)
      return false;
    if (p.bounds.upper < 1e100 && p.bounds.upper > 0.0 &&
        values[i] > thresholds::at_upper_bound * p.bounds.upper)
      return false;
  }
  if (data.model.plant == physics::Plant::equations &&
      (brings_energy(fit.model, fit.model.terms[term]) || !is_affordable(data, fit) ||
       is_known_better(data, fit, term) || !acts(data, fit.model, fit.model.terms[term])))
    return false;
  if (!repeats(data, fit.model.terms[term]) || !is_line(data, fit.model, term) ||
      !lasts(data, fit.model, term) || is_its_own(data, fit.model, term) ||
      is_rounding(data, fit.model, term) || !turns_with_direction(data, fit.model, term))
    return false;
  if (is_lag(fit, term) || never_fills(data, fit, term)) return false;
  // What runs over to nowhere is an upper limit.
  if (info.has("share") && values[info.index_of("share")] < thresholds::arrives_elsewhere) return false;
  // Friction that is smaller at rest than at speed is none.
  if (info.falls_with_speed && values[1] < thresholds::falls_at_least * values[0]) return false;

  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    const auto& f = fit.free[k];
    if (f.where != Freedom::Where::term || f.term != term) continue;
    if (info.parameters[f.index].role != Role::amplitude) continue;
    if (std::abs(get(fit.model, f)) > thresholds::sure_sigmas * fit.sigma(static_cast<Eigen::Index>(k)))
      return true;
  }
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    if (info.parameters[i].role == Role::amplitude) return false;
  return true;  // a term of shapes alone, or a curve
}

}  // namespace invar::diagnosis
