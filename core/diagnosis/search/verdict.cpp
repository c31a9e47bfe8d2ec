#include "core/diagnosis/search/verdict.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/estimate/block_sigma.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/search/suspect.hpp"
#include "core/diagnosis/search/unsure.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Term;

namespace {

/// The share that a name leaves of what was there to explain beyond the noise; `rival`: the model without it, fitted anew.
double rest_left_by(const Case& data, const Fit& best, const Fit& rival, const std::vector<double>& excess) {
  const auto with = squares_left(data, best.model), without = squares_left(data, rival.model);
  std::vector<double> won(excess.size(), 0.0);
  for (std::size_t o = 0; o < won.size(); ++o)
    if (with[o] > 0.0) won[o] = (without[o] / with[o] - 1.0) * (1.0 + excess[o]);
  return rest_beside(won, excess);
}

/// How much of the mismatch still follows what was recorded, beside what the best model explains of it: 0 to 1.
double share_left(const Case& data, const Diagnosis& d, const std::vector<double>& followed) {
  const auto after = squares_left(data, d.best.model), before = squares_left(data, d.retuned.model);
  double left = 0.0, won = 0.0;
  for (std::size_t o = 0; o < after.size(); ++o) {
    if (!(after[o] > 0.0)) continue;
    left += followed[o];
    won += std::max(0.0, before[o] / after[o] - 1.0);
  }
  return left > 0.0 ? left / (left + won) : 0.0;
}

/// What the best model leaves, over what of it is not related from row to row (over the noise that the user gave): the mean of
/// the outputs. How sure a name is was learnt by this measure.
double times_unrelated(const Case& data, const Diagnosis& d) {
  // The fit's own weights may be white, and then what is left counts as noise, all of it.
  const auto coloured = weigh(data, simulate(data, d.best.model));
  double sum = 0.0;
  for (std::size_t o = 0; o < d.heldout.size(); ++o) {
    const double after = d.heldout[o].after, given = data.given_noise[o],
                 unrelated = std::min(d.weighing.filters[o].sigma, coloured.filters[o].sigma),
                 noise = std::isfinite(given) ? given : std::min(after, unrelated);
    sum += noise > 0.0 ? after / noise : 1.0;
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, d.heldout.size()));
}

/// More than twice what the instruments add is mismatch, whatever its colour.
void keep_to_noise(const Case& data, Diagnosis& d) {
  if (!(most_over_noise(d) > thresholds::times_noise)) return;
  if (d.verdict == Verdict::explained) d.verdict = Verdict::partly_explained;
  if (d.verdict != Verdict::no_mismatch && d.verdict != Verdict::parameters_only) return;
  d.verdict = Verdict::unknown_physics;
  d.suspect = most_suspect(data, d);
}

}  // namespace

void give_sigmas(const Case& data, Diagnosis& d) {
  if (!d.is_partial) d.best.sigma = sigma_over_blocks(data, d.weighing, d.best);
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    const std::size_t place = data.model.terms.size() + i;
    finding.term = d.best.model.terms[place];
    finding.sigmas.assign(finding.term.info->parameter_count(), 0.0);
    for (std::size_t k = 0; k < d.best.free.size(); ++k) {
      const auto& f = d.best.free[k];
      if (f.where == Freedom::Where::term && f.term == place)
        finding.sigmas[f.index] = d.best.sigma(static_cast<Eigen::Index>(k));
    }
  }
}

namespace {

/// The model without a claimed term and the free courses over its own variable that stand beside it.
Model without_its_courses(const Case& data, Model model, std::size_t place) {
  const Term named = model.terms[place];
  model = physics::without_term(std::move(model), place);
  for (std::size_t t = model.terms.size(); t-- > data.model.terms.size();)
    if (!model.terms[t].curve.knots.empty() && is_course_of(model.terms[t], named))
      model = physics::without_term(std::move(model), t);
  return model;
}

/// Friction that is needed beside a free course over its own variable is what that course cannot follow: its jump at rest. The freer shape is no rival then, and what is left counts against both together. False: no such course.
bool is_needed_beside_course(const Case& data, const Fit& best, std::size_t place, const Finding& finding) {
  return finding.term.info->is_friction &&
         finding.gain > thresholds::margins_of_a_trifle * thresholds::claim_margin &&
         without_its_courses(data, best.model, place).terms.size() + 1 < best.model.terms.size();
}

/// Shares, gains and probabilities of the findings; returns what each leaves of the mismatch.
std::vector<double> weigh_findings(const Case& data, const std::vector<double>& excess, Diagnosis& d) {
  std::vector<double> rests;
  const auto beyond_best = [&](const Model& model) {
    return residual(data, d.weighing, model).squaredNorm() - d.best.residual.squaredNorm();
  };
  const double mismatch = d.findings.empty() ? 0.0 : beyond_best(data.model),
               rest_of_retuned = d.findings.empty() ? 0.0 : beyond_best(d.retuned.model);
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    const std::size_t place = data.model.terms.size() + i;
    const auto without = physics::without_term(d.best.model, place);
    const double lost = beyond_best(without);
    const auto share_of = [&](double all) { return all > 0.0 ? std::clamp(lost / all, 0.0, 1.0) : 0.0; };
    finding.share = share_of(mismatch);
    finding.share_of_rest = std::max(finding.share, share_of(rest_of_retuned));
    const auto rival =
        fit(data, d.weighing, without, data.model, d.is_partial ? Effort::polish(1) : Effort::follow(5));
    finding.gain = std::min(d.best.evidence - rival.evidence, lead(data, d.best, rival));
    const bool has_course = is_needed_beside_course(data, d.best, place, finding);
    if (has_course) finding.other_shape = 0.0;
    const double rest =
        rest_left_by(data, d.best,
                     has_course ? fit(data, d.weighing, without_its_courses(data, d.best.model, place),
                                      data.model, Effort::follow(5))
                                : rival,
                     excess);
    rests.push_back(rest);
    weigh_name(data, d, place, rest, finding);
  }
  return rests;
}

/// Does another cause at the same place explain as well as one of the findings? A small one beside the chief effect has
/// its rivals in the list, and leaves the verdict on the chief effect as it is. Sizes are shares of the whole mismatch: the
/// user's numbers, retuned, may take most of a chief effect upon themselves, and nothing of a small one.
bool is_ambiguous(const Case& data, const Diagnosis& d) {
  double chief = 0.0;
  for (const auto& finding : d.findings) chief = std::max(chief, finding.share);
  return std::any_of(d.findings.begin(), d.findings.end(), [&](const Finding& finding) {
    return finding.share >= thresholds::small_beside_chief * chief &&
           std::any_of(finding.alternatives.begin(), finding.alternatives.end(), [&](const Alternative& a) {
             return a.explains_as_well() && is_another_cause(data, finding, a) &&
                    !is_elsewhere(finding.term, a.term);
           });
  });
}

/// `follows`: what is left plainly follows what was recorded.
Verdict verdict_without_findings(const Case& data, const Diagnosis& d, bool follows) {
  // What follows the recording is no noise, even where no curve and no name describes it.
  if (follows || is_above_noise(data, d.best) || is_louder_in_motion(data, d.best))
    return Verdict::unknown_physics;
  return d.parameter_excursion > thresholds::moved_sigmas ? Verdict::parameters_only : Verdict::no_mismatch;
}

Verdict verdict_on_findings(const Case& data, const Diagnosis& d, const std::vector<double>& rests) {
  const bool nameless = std::all_of(d.findings.begin(), d.findings.end(),
                                    [](const Finding& f) { return f.stand_in != nullptr; });
  if (d.is_unnamed || nameless) return Verdict::unknown_physics;
  if (is_ambiguous(data, d)) return Verdict::ambiguous;
  const bool leaves_more =
      d.has_rest || d.still_follows > thresholds::little_left ||
      std::any_of(rests.begin(), rests.end(), [](double rest) { return rest > thresholds::little_left; });
  return leaves_more ? Verdict::partly_explained : Verdict::explained;
}

/// The largest ratio of what is left to the noise of an output, at least 1.
double times_noise_left(const Diagnosis& d) {
  double most = d.heldout.empty() ? 1.0 : 0.0;
  for (const auto& row : d.heldout)
    most = std::max(most, row.noise_floor > 0.0 ? row.after / row.noise_floor : 1.0);
  return most;
}

/// The terms that gained most first, without those that were found.
void tidy_rejections(Diagnosis& d) {
  std::sort(d.rejected.begin(), d.rejected.end(),
            [](const auto& a, const auto& b) { return a.gain > b.gain; });
  std::erase_if(d.rejected, [&](const Rejection& r) {
    return std::any_of(d.findings.begin(), d.findings.end(),
                       [&](const Finding& f) { return f.term.info->name == r.term; });
  });
}

}  // namespace

void conclude(const Case& data, Diagnosis& d) {
  const bool own_equations = data.model.plant == physics::Plant::equations;
  auto followed = followed_share(data, d.best);
  // Beside a name that is right little is left; without one, noise may wander far.
  const auto far = far_share(
      data, d.best, d.findings.empty() ? thresholds::wanders_far : thresholds::wanders_far_beside_a_name);
  for (std::size_t o = 0; o < far.size(); ++o) followed[o] = std::max(followed[o], far[o]);
  d.still_follows = share_left(data, d, followed);
  // Where nothing is missing no more than a hundredth did in 150 recordings of machines made by two authors.
  const bool follows = *std::max_element(followed.begin(), followed.end()) > thresholds::plainly_followed;
  if (follows) d.unexplained_over = {"history"};
  // A user who writes down his equations and his noise has said what a model that is whole leaves.
  const auto excess =
      own_equations ? excess_over_noise(data, d.best) : std::vector<double>(data.outputs.size(), 0.0);
  d.parameter_excursion = excursion_of(d.best);
  give_sigmas(data, d);
  const auto rests = weigh_findings(data, excess, d);
  d.nominal = fit(data, d.weighing, data.model, data.model, Effort::evaluate(), &d.retuned);
  d.mismatch_gain = d.best.evidence - d.nominal.evidence;
  d.unexplained = times_noise_left(d);
  const double beyond_unrelated = times_unrelated(data, d);
  leave_unsaid(d, rests,
               *std::max_element(excess.begin(), excess.end()) > thresholds::far_above_given_noise ||
                   (own_equations && beyond_unrelated > thresholds::far_above_unrelated),
               beyond_unrelated);
  doubt_places(d);
  d.verdict =
      d.findings.empty() ? verdict_without_findings(data, d, follows) : verdict_on_findings(data, d, rests);
  if (d.findings.empty() && d.verdict == Verdict::unknown_physics) d.suspect = most_suspect(data, d);
  keep_to_noise(data, d);
  tidy_rejections(d);
}

}  // namespace invar::diagnosis
