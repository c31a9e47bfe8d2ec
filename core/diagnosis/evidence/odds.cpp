#include "core/diagnosis/evidence/odds.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/alike_inputs.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/shape.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

using physics::Plant;
using physics::Term;

bool comes_late(const Term& term) {
  return term.info->lateness == physics::Lateness::delay || term.info->lateness == physics::Lateness::lag;
}

namespace {

bool is_alternative(const Finding& finding, auto is) {
  return std::any_of(finding.alternatives.begin(), finding.alternatives.end(),
                     [&](const Alternative& a) { return is(a.term); });
}

/// One recording shows a sine in the motor's current and one at the carriage alike.
double odds_of_other_site(const Finding& finding) {
  const auto& term = finding.term;
  if (!term.info->is_wave_in_time()) return 0.0;
  const bool is_current = term.info->site == "actuator";
  if (is_current && term.values[term.info->index_of("squareness")] > 0.5) return 0.0;
  if (is_alternative(finding, [](const Term& a) { return a.info->is_wave_in_time(); })) return 0.0;
  const double price = price_of_current(term.values[term.info->index_of("frequency")]);
  return std::exp(0.5 * (is_current ? price : -price));
}

/// A lag and a delay of one time T differ by (s T)^2 / 2 and more: how plainly would the recording show that?
double odds_of_other_lateness(const Case& data, const Fit& best, std::size_t place, const Finding& finding) {
  if (!comes_late(finding.term) || is_alternative(finding, comes_late)) return 0.0;
  // The second difference of the effect over a half of the time to either side is (s T)^2 / 4 for a delay, / 2 for a lag.
  const bool is_delay = finding.term.info->lateness == physics::Lateness::delay;
  return std::exp(-lead_over_shift(data, best, (is_delay ? 2.0 : 1.0) * second_times(data, best, place)));
}

/// A spring before sliding that is stiff enough is no more than friction that slides at once.
double odds_of_sliding_at_once(const Case& data, const Fit& best, std::size_t place, const Finding& finding) {
  const auto& info = *finding.term.info;
  const auto slides_at_once = [](const Term& a) {
    return a.info->is_friction && !a.info->springs_first && !a.info->falls_with_speed;
  };
  if (!info.springs_first || is_alternative(finding, slides_at_once)) return 0.0;
  auto limit = best.model;
  auto& stiffness = limit.terms[place].values[info.index_of("stiffness")];
  stiffness = std::min(thresholds::stiff_as_sliding * stiffness,
                       info.parameters[info.index_of("stiffness")].bounds.upper);
  const auto plain = weigh(data, simulate(data, best.model), Colour::white);
  auto stiff = fit(data, plain, limit, data.model, Effort::evaluate());
  // Two numbers fewer.
  std::erase_if(stiff.free, [&](const Freedom& f) {
    return f.where == Freedom::Where::term && f.term == place && f.index > 0;
  });
  return std::exp(std::min(3.0, -lead(data, best, stiff)));
}

}  // namespace

double odds_of_another_cause(double gain, double left, double shape, double share) {
  return thresholds::other_cause_at_100 *
             std::pow(std::max(gain, 1.0) / 100.0, -thresholds::other_cause_slope) +
         thresholds::other_cause_by_left * (left + shape) +
         thresholds::other_cause_by_shape * std::min(1.0, shape / thresholds::other_cause_form) +
         (share < 1.0 ? thresholds::other_cause_ideal / std::max(share, 1e-6) : 0.0);
}

double odds_of_nothing(const Finding& finding) {
  double surest = -1.0;
  for (std::size_t i = 0; i < finding.sigmas.size(); ++i)
    if (finding.term.info->parameters[i].role == physics::Role::amplitude && finding.sigmas[i] > 0.0)
      surest = std::max(surest, std::abs(finding.term.values[i]) / finding.sigmas[i]);
  return surest < 0.0 ? 0.0 : thresholds::odds_of_zero * std::exp(-0.5 * surest * surest);
}

double odds_of_relatives(const Case& data, const Fit& best, std::size_t place, const Finding& finding) {
  // Where the current is recorded behind what acts on it, a force does not stand in it.
  return (data.model.records_applied ? 0.0 : odds_of_other_site(finding)) +
         odds_of_other_lateness(data, best, place, finding) +
         odds_of_sliding_at_once(data, best, place, finding);
}

bool is_another_cause(const Case& data, const Finding& finding, const Alternative& alternative) {
  const auto &one = finding.term, &other = alternative.term;
  const auto& inputs = data.model.equations.inputs;
  const bool is_over_another_input =
      one.with != other.with && std::any_of(inputs.begin(), inputs.end(), [&](const auto& input) {
        return input.symbol == one.with || input.symbol == other.with;
      });
  return one.info != other.info || one.on != other.on || is_over_another_input ||
         one.info->plant != Plant::equations;
}

bool is_elsewhere(const Term& one, const Term& other) {
  return one.info == other.info && one.info->plant == Plant::equations && one.on != other.on &&
         // What comes late or is cut off does so on the way to a state as in it.
         (one.info->lateness != physics::Lateness::none || one.info->cut != physics::Cut::nothing ||
          variable_of(one) == variable_of(other));
}

double rest_beside(const std::vector<double>& won, const std::vector<double>& excess) {
  double all = 0.0, most = 0.0;
  for (const double one : won) all += std::max(0.0, one);
  for (std::size_t o = 0; o < won.size(); ++o)
    if (won[o] > thresholds::part_of_gain * all) most = std::max(most, excess[o] / (excess[o] + won[o]));
  return most;
}

double probability_of(const Finding& finding, const Alternative& alternative) {
  return finding.probability * std::exp(0.5 * std::min(0.0, alternative.log_odds));
}

void weigh_name(const Case& data, const Diagnosis& d, std::size_t place, double rest, Finding& finding) {
  double sum = 1.0;
  for (const auto& a : finding.alternatives)
    if (is_another_cause(data, finding, a)) sum += std::exp(std::min(0.0, 0.5 * a.log_odds));
  finding.other_cause = 0.0;
  if (finding.term.curve.knots.empty()) {
    finding.relatives = odds_of_relatives(data, d.best, place, finding);
    finding.other_cause =
        odds_of_another_cause(finding.gain, std::max(rest, d.still_follows), finding.other_shape,
                              d.findings.size() > 1 ? finding.share_of_rest : 1.0);
    finding.other_cause += std::clamp(d.parameter_excursion / thresholds::far_astray - 1.0, 0.0,
                                      thresholds::other_cause_by_excursion);
    finding.other_cause += odds_of_nothing(finding);
    sum += finding.relatives + finding.other_cause;
  } else {  // a free course takes after any of the inputs that run alike
    sum += static_cast<double>(inputs_like(data, finding.term.curve.over));
  }
  // A course over time follows anything slow and foretells nothing: another place is as likely.
  if (is_over_time(finding.term)) sum += 1.0;
  finding.probability = std::min(thresholds::surest, 1.0 / sum);
}

}  // namespace invar::diagnosis
