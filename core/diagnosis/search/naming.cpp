// Names one by one, two at once, and what the noise of a loop makes of them.
#include "core/diagnosis/search/search.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/evidence/shaken_loose.hpp"
#include "core/diagnosis/search/among_names.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/pairs.hpp"
#include "core/diagnosis/search/steady_speed.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Role;
using physics::Term;

namespace {

/// Has no number of a term that stands in both moved by more than a fiftieth?
bool settled(const Model& before, const Model& now) {
  for (std::size_t t = 0; t < now.terms.size(); ++t)
    for (std::size_t i = 0; i < now.terms[t].info->parameter_count(); ++i)
      if (now.terms[t].info->parameters[i].role == Role::amplitude &&
          std::abs(now.terms[t].values[i] - before.terms[t].values[i]) >
              0.02 * std::abs(before.terms[t].values[i]))
        return false;
  return true;
}

}  // namespace

Search::Sought Search::seek(From from, double share) {
  // Filters fitted to a residual that is not noise yet take much of the effect away; where they leave nothing to see,
  // every row counts alike. Either way a claim is judged under the filters of its own residual.
  const bool coloured = from == From::coloured;
  Sought sought;
  const Weighing weighing =
      coloured ? d_.weighing
               : weigh(data_, simulate(data_, from == From::believed ? data_.model : d_.best.model),
                       Colour::white);
  sought.base =
      coloured ? d_.best : fit(data_, weighing, d_.best.model, data_.model, Effort::follow(4), &d_.best);
  progress_(share, "screening candidates");
  const Naming naming{data_, *noise_, options_, rivals_.empty(), margin()};
  const bool is_first = d_.best.model.terms.size() == given();
  auto list = shortlisted(
      naming, weighing,
      from == From::believed ? fit(data_, weighing, data_.model, data_.model, Effort::evaluate())
                             : sought.base,
      is_first ? alone_ : std::vector<Model>{}, [&] { progress_(share + 0.04, "fitting the short list"); });
  for (const auto& r : list.impossible) d_.reject(r.term, r.why, r.gain);
  last_screen_ = std::move(list.screened);
  sought.fits = std::move(list.fits);
  sought.best = leader(naming, sought.base, sought.fits);
  return sought;
}

std::optional<std::string> Search::why_not(const OneName& name) {
  if (rivals_.empty() || !options_.refuses) return std::nullopt;
  const auto &with = name.with, &without = name.without;
  if (!noise_->shows(with.model, without.model, thresholds::seen_further) &&
      noise_->gain(with.model, without.model, name.weighing) < thresholds::margins_of_a_trifle * margin())
    return "in the noise of this loop its effect would not show";
  if (is_trifle(data_, d_.retuned, without, with))
    return "less than what the idealised form of the others may leave";
  // What the wrong form of an earlier term leaves over is no further physics.
  if (const auto other = other_form(data_, name.weighing, without, with))
    return "another course of " + std::string{without.model.terms[other->term].info->name} +
           " over its own variable explains the same";
  return std::nullopt;
}

bool Search::leads_out(const OneName& name) {
  if (std::exchange(led_out_, true)) return false;
  const auto model = physics::without_term(name.with.model, given());
  auto anew = fit(data_, name.weighing, model, data_.model, Effort::follow(8), &name.with);
  if (!(anew.cost < name.without.cost) ||
      least_ratio(data_, anew, name.without) > thresholds::half_of_squares)
    return false;
  d_.weighing = weigh(data_, simulate(data_, anew.model), Colour::white);
  anew = fit(data_, d_.weighing, anew.model, data_.model, Effort::follow(8), &anew);
  d_.weighing = weigh(data_, simulate(data_, anew.model));
  d_.best = d_.retuned = fit(data_, d_.weighing, anew.model, data_.model, Effort::follow(4), &anew);
  return true;
}

/// The evidence counts rows; the gain that a claim needs is held against slow noise too.
std::string Search::why_it_does_not_pay(double evidence) const {
  if (evidence < margin()) return "it explains no more than chance would";
  return noise_->is_fed_back() ? "noise that the loop feeds back can explain the same"
                               : "a slow wander of the readings can explain the same";
}

/// Adds the term that explains most, if one stands under the filters that its own residual asks for.
bool Search::add_named(double round) {
  const bool is_first = d_.best.model.terms.size() == given();
  for (const auto from : {From::coloured, From::plain, From::believed}) {
    if (from == From::believed && !(is_first && may_lead_astray(d_.best))) break;
    const double share = 0.1 + 0.2 * round + (from == From::coloured ? 0.0 : 0.1);
    auto sought = seek(from, share);
    const bool pays = sought.best && sought.best->gain >= margin();
    if (from == From::coloured && take_shaken(sought.base, pays ? &sought.best->with : nullptr)) return true;
    if (!pays) {
      for (const auto& f : sought.fits) {
        const double evidence = f.evidence - sought.base.evidence;
        d_.reject(std::string{f.model.terms.back().info->name}, why_it_does_not_pay(evidence), evidence);
      }
      continue;
    }
    const auto rather = [&](From other_base, double leaves) {
      if (auto other = seek(other_base, share);
          other.best && other.best->gain >= margin() &&
          lead(data_, other.best->with, sought.best->with) > 0.0 &&
          least_ratio(data_, other.best->with, sought.best->with) < leaves)
        sought = std::move(other);
    };
    // What is steady or slow is not seen through filters that hold it for noise; what is swift is, and comes first. The noise
    // that a loop feeds back is slow too: there a name must take half of what the swift one leaves.
    if ((is_first || is_heat()) && data_.is_time_series && from == From::coloured)
      rather(From::plain, noise_->is_fed_back() ? thresholds::half_of_squares : 1.0);
    if (is_first && is_equations() && excursion_of(sought.best->with) > thresholds::far_astray)
      rather(From::believed, 1.0);
    const auto& best = *sought.best;
    if (is_first && is_equations() && leads_out(best)) return add_named(round);
    if (const auto why = why_not(best)) {
      d_.reject(std::string{best.with.model.terms.back().info->name}, *why, best.gain);
      continue;
    }
    claim(std::move(sought));
    return true;
  }
  return false;
}

void Search::claim(Sought sought) {
  auto& [base, fits, best] = sought;
  std::vector<Term> rivals;
  std::set<std::string> named{label(best->with.model.terms.back())};
  for (const auto& f : fits) {
    if (!named.insert(label(f.model.terms.back())).second) continue;
    if (f.evidence > base.evidence + 0.3 * (fits[best->place].evidence - base.evidence) && rivals.size() < 4)
      rivals.push_back(f.model.terms.back());
    else
      d_.reject(std::string{f.model.terms.back().info->name}, "another term explains the same better",
                f.evidence - base.evidence);
  }
  if (auto twin = twin_at_steady_speed(data_, best->with.model.terms.back()))
    rivals.push_back(std::move(*twin));
  d_.weighing = std::move(best->weighing);
  d_.best = std::move(best->with);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(5), &d_.retuned);
  rivals_.push_back(std::move(rivals));
}

bool Search::take_shaken(const Fit& base, Fit* otherwise) {
  if (!options_.refuses) return false;
  const auto found = shaken_loose(data_, *noise_, d_.weighing, base, options_.without);
  if (!found || found->gain < (rivals_.empty() ? 1.0 : thresholds::margins_of_a_trifle) * margin())
    return false;
  if (otherwise != nullptr) {
    const double numbers =
                     static_cast<double>(otherwise->free.size()) - static_cast<double>(base.free.size()),
                 rows = std::max(10.0, found->weighing.temper * static_cast<double>(base.residual.size())),
                 gain = noise_->gain(otherwise->model, found->without, found->weighing) -
                        0.5 * numbers * std::log(rows);
    if (gain > found->gain) return false;
    const auto &term = otherwise->model.terms.back(), &own = found->model.terms.back();
    if (term.info == own.info) {
      otherwise->model = found->model;
      return false;
    }
    if (term.info->is_friction && own.info->is_friction)
      return false;  // of the laws the ordinary way decides
  }
  const auto without = d_;
  const auto readings = noise_->now();
  d_.best.model = found->model;
  (void)quieten();
  if (!stands(data_, d_.best, d_.best.model.terms.size() - 1)) {
    d_ = without;
    noise_->put(readings);
    return false;
  }
  rivals_.emplace_back();
  if (otherwise != nullptr)
    d_.reject(std::string{otherwise->model.terms.back().info->name},
              "dither by the noise explains the same better", found->gain);
  return true;
}

double Search::quieten() {
  if (!options_.refuses || data_.model.plant != physics::Plant::axis) return 0.0;
  const double untold = noise_->take_off(d_.best.model);
  const auto near = fit(data_, weigh(data_, simulate(data_, d_.best.model), Colour::white), d_.best.model,
                        data_.model, Effort::follow(4), &d_.best);
  d_.weighing = weigh(data_, simulate(data_, near.model));
  d_.best = fit_near(data_, d_.weighing, near, Effort::follow(4), thresholds::leads_away);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(4), &d_.retuned);
  return untold;
}

void Search::settle() {
  if (d_.best.model.terms.size() == given()) return;
  for (int again = 0; again < 4; ++again) {
    const auto was = d_.best.model;
    (void)quieten();
    if (settled(was, d_.best.model)) return;
  }
}

bool Search::add_pair(const Fit* rival) {
  progress_(rival == nullptr ? 0.05 : 0.9, "screening pairs");
  auto [claim, alone] = claim_pair(data_, d_.best, options_.without, rival);
  alone_.insert(alone_.end(), alone.begin(), alone.end());
  if (!claim) return false;
  d_.best = std::move(claim->fit);
  d_.weighing = std::move(claim->weighing);
  rivals_ = std::move(claim->rivals);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(5), &d_.retuned);
  (void)quieten();
  return true;
}

bool Search::put_one_in_place(const Diagnosis& begun) {
  if (!(excursion_of(d_.best) > thresholds::far_astray)) return false;
  auto pair = std::exchange(d_, begun);
  auto pairs_rivals = std::exchange(rivals_, {});
  auto screened = last_screen_;
  auto sought = seek(From::believed, 0.1);
  if (sought.best && sought.best->gain >= margin() && lead(data_, sought.best->with, pair.best) > 0.0) {
    claim(std::move(sought));
    return true;
  }
  d_ = std::move(pair);
  rivals_ = std::move(pairs_rivals);
  last_screen_ = std::move(screened);
  return false;
}

/// More effects beside one another are better looked at in parts; of heat each node has its exchange, its loss and its sensor.
/// In equations with states friction beside a drag looks like another power until both are there: a fourth where a run is quick.
constexpr std::size_t most_names = 3, most_names_of_more = 4;

void Search::name(int first_round) {
  const std::size_t most = is_heat() || (is_quick(data_) && !data_.model.equations.states.empty())
                               ? most_names_of_more
                               : most_names;
  const bool began_as_pair = first_round == 2;
  auto round = static_cast<std::size_t>(first_round);
  for (int again = 0; again < 2; ++again) {
    for (; round < most; ++round)
      if (!take("further terms of the library", [&] { return add_named(static_cast<double>(round)); }) ||
          !take("further terms of the library", [&] {
            if (quieten() > 0.02) settle();  // which rows are chance shows once the claims have their size
            return true;
          }))
        break;
    if (rivals_.empty()) return;
    take("other laws of the same kind",
         [&] { return put_laws_right(data_, d_, rivals_, options_.without), true; });
    const std::size_t claimed = rivals_.size();
    if (options_.refuses) take(all_needed, [&] { return prune(data_, d_, rivals_, options_.without), true; });
    // One of a pair, claimed before names were sought one by one, leaves its place to what was not sought yet.
    if (!began_as_pair || claimed < most || rivals_.size() == claimed) break;
    round = rivals_.size();
  }
  progress_(0.7, "comparing with near twins");
  if (!take(rivals_weighed,
            [&] { return weigh_alternatives(data_, d_, rivals_, options_.claims()), true; })) {
    data_.stop = {};
    weigh_alternatives(data_, d_, rivals_, options_.claims());  // the terms as they stand
  }
}

}  // namespace invar::diagnosis
