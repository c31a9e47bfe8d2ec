#include "core/diagnosis/search/unsure.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/foretold.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/evidence/shape.hpp"
#include "core/diagnosis/search/unnamed.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// Do states carry on from row to row? A map or an instrument is read point by point, and what drifts there is a cause.
bool is_in_motion(const Case& data) {
  return data.model.plant == physics::Plant::axis || data.model.plant == physics::Plant::thermal ||
         data.model.plant == physics::Plant::equations;
}

/// Is most of what a name explains foretold on rows that no fit saw? A course over time takes anything slow and foretells
/// nothing: it is no cause in place of such a name.
bool foretells(const Case& data, const Diagnosis& d, std::size_t finding) {
  const auto model = physics::without_term(d.best.model, data.model.terms.size() + finding);
  return foretold(data, d.best, fit(data, d.weighing, model, data.model, Effort::follow(5))).is_plain();
}

/// Does a course over a name's own variable leave plainly more than the two together? Then the course is the name's rest, and
/// no cause in its place: it rounds the jump of friction off.
bool is_needed_beside(const Case& data, const Diagnosis& d, std::size_t finding, const OtherCause& other) {
  const auto& course = other.fit.model.terms.back();
  const auto& term = d.best.model.terms[data.model.terms.size() + finding];
  if (!term.info->is_friction || !is_course_of(course, term)) return false;
  auto both = d.best.model;
  both.terms.push_back(course);
  const auto plain = weigh(data, simulate(data, other.fit.model), Colour::white);
  const auto together = fit(data, plain, both, data.model, Effort::follow(8));
  return is_affordable(data, together) &&
         lead(data, together, other.fit) > thresholds::margins_of_a_trifle * thresholds::claim_margin &&
         least_ratio(data, together, other.fit) < thresholds::seen_beside;
}

}  // namespace

void doubt(const Case& data, Diagnosis& d, std::optional<Beside>& beside) {
  for (std::size_t i = d.findings.size(); i-- > 0;) {
    if (!beside) beside = courses_beside(data, d.best);
    const auto other = other_cause(data, *beside, data.model.terms.size() + i);
    if (!other ||
        (is_in_motion(data) && is_over_time(other->fit.model.terms.back()) && foretells(data, d, i)) ||
        is_needed_beside(data, d, i, *other)) {
      d.findings[i].other_shape = other_shape(data, *beside, data.model.terms.size() + i).share;
      continue;
    }
    beside.reset();
    d.reject(
        std::string{d.best.model.terms[data.model.terms.size() + i].info->name},
        "a free course over " + other->fit.model.terms.back().curve.over + " does far better in its place",
        other->lead);
    const auto model = physics::without_term(d.best.model, data.model.terms.size() + i);
    d.findings.erase(d.findings.begin() + static_cast<std::ptrdiff_t>(i));
    d.weighing = weigh(data, simulate(data, other->fit.model));
    d.best = fit(data, d.weighing, model, data.model, Effort::follow(8));
    d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
  }
}

bool set_aside(const Case& data, Diagnosis& d) {
  const std::size_t given = data.model.terms.size();
  auto model = d.best.model;
  std::vector<Finding> kept;
  std::optional<Finding> nearest;  // of the names that go
  std::set<std::string_view> sites;
  for (std::size_t i = d.findings.size(); i-- > 0;) {
    const auto& finding = d.findings[i];
    const bool is_curve = !finding.term.curve.knots.empty();
    if (!is_curve && !(finding.other_cause > thresholds::unlikely_odds)) {
      kept.insert(kept.begin(), finding);
      continue;
    }
    model = physics::without_term(std::move(model), given + i);
    if (is_curve) continue;
    sites.insert(finding.term.info->site);
    if (!nearest || finding.gain > nearest->gain) nearest = finding;
  }
  if (!nearest) return false;
  if (nearest->stand_in != nullptr) nearest->term.info = nearest->stand_in;
  const auto plain = weigh(data, simulate(data, d.best.model), Colour::white);
  const Fit base = fit(data, plain, model, data.model, Effort::follow(6));
  // The curves must do better than the name: drops move in two directions, and heat in several nodes.
  Curved found;
  found.fit = base;
  std::size_t curves = 0;
  while (curves < 3 && lead(data, found.fit, d.best) < 0.0) {
    auto next = best_curve(data, found.fit, courses_beside(data, found.fit, &d.best));
    // What another place explains beside them says nothing against the names here.
    if (next.gain < thresholds::nameless_margins * claim_margin_of(d.weighing) ||
        !sites.contains(next.fit.model.terms.back().info->site))
      return false;
    found = std::move(next);
    ++curves;
  }
  if (curves == 0 || lead(data, found.fit, d.best) < 0.0 || !takes_far_more(data, d, found.fit)) return false;
  d.best = std::move(found.fit);
  d.weighing = std::move(found.weighing);
  (kept.empty() ? d.is_unnamed : d.has_rest) = true;
  d.findings = std::move(kept);
  for (std::size_t k = curves; k > 0; --k) {
    Finding finding;
    finding.term = d.best.model.terms[d.best.model.terms.size() - k];
    finding.alternatives.push_back({nearest->term, -2.0 * std::log(nearest->other_cause)});
    d.findings.push_back(finding);
  }
  d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
  return true;
}

bool leave_out_unseen(Diagnosis& d) {
  if (d.findings.empty() || !std::all_of(d.findings.begin(), d.findings.end(),
                                         [](const Finding& f) { return f.stand_in != nullptr; }))
    return false;
  if (std::any_of(d.heldout.begin(), d.heldout.end(),
                  [](const FitRow& row) { return row.after < thresholds::seen_alone * row.retuned; }))
    return false;
  for (const auto& finding : d.findings)
    d.reject(std::string{finding.stand_in->name}, "another cause is likelier, and it hardly shows",
             finding.gain);
  d.findings.clear();
  d.best = d.retuned;
  for (auto* rows : {&d.heldout, &d.train})
    for (auto& row : *rows) row.after = row.retuned;
  return true;
}

void leave_unsaid(Diagnosis& d, const std::vector<double>& rests, bool is_far, double times_the_noise) {
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    // Of the user's own equations a number may be far off: what he left out there is often a part of it.
    const bool is_astray = d.parameter_excursion > thresholds::far_astray &&
                           finding.term.info->plant != physics::Plant::equations;
    const double least = is_far && times_the_noise > thresholds::very_far_above_noise
                             ? thresholds::said_very_far
                         : is_far || is_astray || rests[i] > thresholds::plain_rest ? thresholds::said_far
                                                                                    : thresholds::said_at_all;
    if (!finding.term.curve.knots.empty() || finding.probability >= least) continue;
    finding.stand_in = finding.term.info;
    finding.term.info = physics::unmodelled(finding.stand_in->plant, finding.stand_in->site);
    finding.probability = 1.0 - finding.probability;
    finding.sigmas.clear();
    finding.alternatives.clear();
  }
}

void doubt_places(Diagnosis& d) {
  if (!(most_over_noise(d) > thresholds::times_noise)) return;
  double left = 0.0, missing = 0.0;  // in the power of the noise
  for (const auto& row : d.heldout) {
    if (!(row.noise_floor > 0.0)) continue;
    left += std::pow(row.after / row.noise_floor, 2);
    missing += std::pow(row.retuned / row.noise_floor, 2);
  }
  const double share = missing > 0.0 ? std::max(0.0, 1.0 - std::sqrt(left / missing)) : 0.0,
               most = thresholds::place_alone + (thresholds::surest - thresholds::place_alone) * share;
  for (auto& finding : d.findings)
    if (finding.stand_in != nullptr || !finding.term.curve.knots.empty())
      finding.probability = std::min(finding.probability, most);
}

}  // namespace invar::diagnosis
