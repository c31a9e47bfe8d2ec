#include "core/diagnosis/search/among_names.hpp"

#include <algorithm>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/search/steady_speed.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Term;

namespace {

/// What a steady rate and the limit where it ends do together, the friction of that way does alone: the models without the
/// limit in which it stands for the rate.
std::vector<Model> with_friction(const Case& data, const Term& removed, const Model& model,
                                 const std::set<std::string, std::less<>>& without) {
  std::vector<Model> all;
  if (removed.info->cut != physics::Cut::beyond_a_limit) return all;
  for (std::size_t t = data.model.terms.size(); t < model.terms.size(); ++t)
    if (model.terms[t].info->is_steady && model.terms[t].on == removed.on)
      for (auto& other : other_laws(data, model, t, without)) all.push_back(std::move(other));
  return all;
}

}  // namespace

namespace {

/// Were the two told apart at a steady speed by a tenth of a residual that is far above noise? What nobody listed does that too.
bool looks_alike(const Case& data, const Fit& best, const Fit& rival, std::size_t place) {
  const auto twin = twin_at_steady_speed(data, best.model.terms[place]);
  if (!twin || twin->info != rival.model.terms[place].info ||
      least_ratio(data, best, rival) < thresholds::told_by_a_tenth)
    return false;
  const auto simulated = simulate(data, best.model);
  const auto left = squares_left(data, simulated, weigh(data, simulated, Colour::white));
  for (std::size_t o = 0; o < left.size(); ++o)
    if (left[o].rms() > thresholds::times_noise * instrument_noise(data, simulated, o)) return true;
  return false;
}

}  // namespace

void prune(const Case& data, Diagnosis& d, Rivals& rivals,
           const std::set<std::string, std::less<>>& without_names) {
  const std::size_t given = data.model.terms.size();
  for (std::size_t i = 0; given + i < d.best.model.terms.size() && d.best.model.terms.size() > given + 1;
       ++i) {
    const std::size_t place = given + i;
    const Term removed = d.best.model.terms[place];
    Model model = physics::without_term(d.best.model, place);
    // What one friction law gives up another may take over.
    for (std::size_t t = given; t < model.terms.size(); ++t)
      if (removed.info->is_friction && model.terms[t].info->is_friction) {
        model.terms[t].values[0] += 0.7 * removed.values[0];
        if (model.terms[t].info->falls_with_speed) model.terms[t].values[1] += removed.values[0];
      }
    auto without = fit(data, d.weighing, model, data.model, Effort::follow(10));
    for (const auto& other : with_friction(data, removed, model, without_names))
      if (auto one = fit(data, d.weighing, other, data.model, Effort::follow(10));
          one.evidence > without.evidence)
        without = std::move(one);
    bool possible = true;
    for (std::size_t t = given; t < without.model.terms.size(); ++t)
      possible = possible && (stands(data, without, t) || !stands(data, d.best, t < place ? t : t + 1));
    if (!possible) continue;
    const double gain = advantage(data, d.weighing, d.best, without), margin = claim_margin_of(d.weighing),
                 counted = lead(data, d.best, without);
    // Nor is it dropped because filters that grew on what the others leave see little of it.
    if (!data.model.controller && counted > 0.0 &&
        least_ratio(data, d.best, without) < thresholds::half_of_squares)
      continue;
    // What makes the readings themselves lie farther off pleases the filters only.
    if (gain > margin && counted > 0.0 &&
        (least_ratio(data, d.best, without) < thresholds::seen_further ||
         gain > margins_of_a_further(data, gain, counted) * margin))
      continue;
    d.reject(std::string{removed.info->name}, "the others explain it without",
             d.best.evidence - without.evidence);
    d.best = std::move(without);
    const auto at = static_cast<std::ptrdiff_t>(i);
    if (i < rivals.size()) rivals.erase(rivals.begin() + at);
    if (i < d.findings.size()) d.findings.erase(d.findings.begin() + at);
    d.weighing = weigh(data, simulate(data, d.best.model));
    d.best = fit(data, d.weighing, d.best.model, data.model, Effort::follow(4), &d.best);
    d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
    i = static_cast<std::size_t>(-1);
  }
}

void put_laws_right(const Case& data, Diagnosis& d, Rivals& rivals,
                    const std::set<std::string, std::less<>>& without) {
  for (std::size_t i = 0; i < rivals.size(); ++i) {
    const std::size_t place = data.model.terms.size() + i;
    const Term claimed = d.best.model.terms[place];
    const auto plain = weigh(data, simulate(data, d.best.model), Colour::white);
    auto best = fit(data, plain, d.best.model, data.model, Effort::evaluate(), &d.best);
    for (auto& other : fits_of_other_laws(data, plain, best, place, without))
      if (other.evidence > best.evidence && stands(data, other, place)) best = std::move(other);
    if (label(best.model.terms[place]) == label(claimed)) continue;
    rivals[i].push_back(claimed);
    d.weighing = weigh(data, simulate(data, best.model));
    d.best = fit(data, d.weighing, best.model, data.model, Effort::follow(8), &best);
    d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
  }
}

void weigh_alternatives(const Case& data, Diagnosis& d, Rivals& rivals, Claims claims) {
  for (int pass = 0; pass < 2; ++pass)
    for (std::size_t i = 0; i < rivals.size(); ++i) {
      const std::size_t place = data.model.terms.size() + i;
      if (place >= d.best.model.terms.size()) break;
      Finding finding;
      std::vector<Term> kept;
      for (const auto& rival : rivals[i]) {
        if (data.stop.stop_requested()) break;
        const auto is_same = [&](const Term& other) { return label(other) == label(rival); };
        if (is_same(d.best.model.terms[place]) || std::any_of(kept.begin(), kept.end(), is_same)) continue;
        Model model = d.best.model;
        model.terms[place] = rival;
        auto f = fit(data, d.weighing, model, data.model, Effort::follow(8), &d.best);
        double odds = advantage(data, d.weighing, f, d.best);
        if (odds > 0.0 && !data.model.controller)  // not what pleases the filters only
          odds = std::min(odds, lead(data, f, d.best));
        if (odds > thresholds::better_after_all &&
            stands(data, f, place)) {  // better after all, beside the other terms
          kept.push_back(d.best.model.terms[place]);
          finding.alternatives.push_back({d.best.model.terms[place], -odds});
          for (auto& a : finding.alternatives) a.log_odds -= odds;
          d.best = std::move(f);
          continue;
        }
        if (claims == Claims::checked && !stands(data, f, place)) continue;
        kept.push_back(f.model.terms[place]);
        if (looks_alike(data, d.best, f, place)) odds = std::max(odds, thresholds::odds_of_twins);
        finding.alternatives.push_back({f.model.terms[place], odds});
      }
      rivals[i] = kept;
      finding.term = d.best.model.terms[place];
      if (pass == 1 || rivals.size() == 1) {
        if (d.findings.size() <= i) d.findings.resize(i + 1);
        d.findings[i] = finding;
      }
      if (rivals.size() == 1 && pass == 0) pass = 1;
    }
}

}  // namespace invar::diagnosis
