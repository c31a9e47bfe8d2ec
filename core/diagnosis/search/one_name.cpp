#include "core/diagnosis/search/one_name.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/foretold.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/wander.hpp"
#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/segments/excerpt.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

bool by_evidence(const Fit& a, const Fit& b) { return a.evidence > b.evidence; }

/// Candidates in the order of first order, two starts of a name at a place, as many as go on together: `most`, and what
/// first order cannot tell from the last of them. Begins at `from`, which is moved behind them.
std::vector<const Screened*> next_of(const std::vector<Screened>& screened, std::size_t& from,
                                     std::map<std::string, int>& seen) {
  constexpr std::size_t most = 9;
  std::vector<const Screened*> next;
  for (; from < screened.size(); ++from) {
    const auto& s = screened[from];
    if (s.impossible) continue;
    if (s.merit < -3.0 || (next.size() >= most && s.merit < next.back()->merit - 0.5)) break;
    if (seen[label(s.start.term)]++ < 2) next.push_back(&s);
  }
  return next;
}

/// A few steps each; those that lag far behind the leader are not driven further.
std::vector<Fit> fits_of(const Naming& naming, const Weighing& weighing, const Fit& base,
                         const std::vector<const Screened*>& tried) {
  const auto& data = naming.data;
  const auto& options = naming.options;
  std::vector<Fit> fits(tried.size());
  const auto some = excerpt(data, weighing, base, 40 * fits.size());
  in_parallel(fits.size(), [&](std::size_t i) {
    fits[i] = some ? on_all(data, weighing, base,
                            fit_with(some->data, some->weighing, some->base, *tried[i], Effort::polish(3)))
                   : fit_with(data, weighing, base, *tried[i], Effort::polish(3));
  });
  const auto go_on = [&](Fit& f) {
    if (!options.stop.stop_requested()) f = fit(data, weighing, f.model, data.model, Effort::follow(8), &f);
  };
  if (const auto best = std::min_element(fits.begin(), fits.end(), by_evidence); best != fits.end()) {
    go_on(*best);
    const double gained = std::max(1.0, best->evidence - base.evidence);
    std::vector<Fit*> near;
    // Of heat those that gain are still on their way: from a base far off three steps do not bring them to their end.
    const bool all_go_on = data.model.plant == physics::Plant::thermal;
    for (auto& f : fits)
      if (&f != &*best && (f.evidence > best->evidence - std::max(15.0, 0.5 * gained) ||
                           (all_go_on && f.evidence > base.evidence + thresholds::claim_margin)))
        near.push_back(&f);
    in_parallel(near.size(), [&](std::size_t i) { go_on(*near[i]); });
  }
  if (data.model.plant == physics::Plant::equations && !fits.empty()) {
    const auto first = std::min_element(fits.begin(), fits.end(), by_evidence);
    const std::size_t place = first->model.terms.size() - 1;
    for (auto& other : fits_of_other_laws(data, weighing, *first, place, options.without))
      fits.push_back(std::move(other));
  }
  if (options.refuses)
    std::erase_if(fits, [&](const Fit& f) { return !stands(data, f, f.model.terms.size() - 1); });
  return fits;
}

}  // namespace

Shortlist shortlisted(const Naming& naming, const Weighing& weighing, const Fit& base,
                      const std::vector<physics::Model>& alone, const std::function<void()>& fitting) {
  const auto& data = naming.data;
  Shortlist list;
  list.screened = screen(data, weighing, base, named_starts(data, weighing, base, naming.options.without), 0);
  fitting();
  auto& fits = list.fits;
  for (const auto& model : alone) fits.push_back(fit(data, weighing, model, data.model, Effort::follow(8)));
  if (naming.options.refuses)
    std::erase_if(fits, [&](const Fit& f) { return !stands(data, f, f.model.terms.size() - 1); });
  // First order is misled where the base is far from what is right: where the first do not stand once they are fitted, the
  // next are tried.
  constexpr int batches = 3;
  std::size_t from = 0;
  std::map<std::string, int> seen;
  const auto is_better = [&](const Fit& f) { return f.evidence > base.evidence + thresholds::claim_margin; };
  for (int batch = 0; batch < batches; ++batch) {
    if (batch > 0 && std::any_of(fits.begin(), fits.end(), is_better)) break;
    const auto tried = next_of(list.screened, from, seen);
    if (tried.empty()) break;
    for (auto& f : fits_of(naming, weighing, base, tried)) fits.push_back(std::move(f));
  }
  for (std::size_t i = 0; i < from; ++i)
    if (const auto& s = list.screened[i]; s.impossible && s.merit > 3.0)
      list.impossible.push_back({std::string{s.start.term.info->name}, why_impossible(s.start), s.merit});
  std::sort(fits.begin(), fits.end(), by_evidence);
  return list;
}

namespace {

/// A name followed to its end, held against the model without it.
struct Followed {
  std::optional<OneName> name;  // nothing: it does not show
  double rank = -1e300;
};

/// A wave was looked for at many frequencies.
bool is_sought(const physics::Term& term) { return term.info->index_of("phase") < physics::most_parameters; }

Followed follow(const Naming& naming, const Fit& base, const Fit& start, bool has_rivals) {
  const auto& [data, noise, options, is_first, margin] = naming;
  // Filters that a wrong residual asked for would keep it wrong: all rows alike first, then the filters of what is left.
  Weighing plain = weigh(data, simulate(data, start.model), Colour::white);
  auto settled = fit(data, plain, start.model, data.model, Effort::follow(6), &start);
  for (int again = 0; again < 3; ++again) {  // the nearer the fit, the finer its scale
    plain = weigh(data, simulate(data, settled.model), Colour::white);
    auto nearer = fit(data, plain, settled.model, data.model, Effort::follow(5), &settled);
    const bool arrived = least_ratio(data, nearer, settled) > 0.97;
    settled = std::move(nearer);
    if (arrived) break;
  }
  Weighing own = weigh(data, simulate(data, settled.model));
  auto with = fit_near(data, own, settled, Effort::follow(6), thresholds::leads_away);
  auto without = fit(data, own, base.model, data.model, Effort::follow(4), &base);
  double evidence = advantage(data, own, with, without);
  // Half of the squares are no noise, whatever their colour: where the filters see less in that than its independent rows
  // say (a sign turns within a row, and they look at what comes anew in each), all rows count alike.
  if (options.refuses && !noise.is_fed_back() && data.is_time_series && data.windows.count == 0 &&
      least_ratio(data, with, without) < thresholds::half_of_squares &&
      evidence < lead(data, with, without)) {
    own = plain;
    with = fit(data, own, settled.model, data.model, Effort::follow(6), &settled);
    without = fit(data, own, base.model, data.model, Effort::follow(4), &base);
    evidence = advantage(data, own, with, without);
  }
  double gain = std::min(evidence, noise.is_fed_back() ? noise.beyond(with.model, without.model, own)
                                                       : advantage_over_wander(data, own, with, without));
  const double counted = lead(data, with, without);
  if (const double least = std::min(evidence, counted);
      options.refuses && gain < 2.0 * margin && least > 2.0 * margin &&
      (is_white(evidence, counted) || goes_with_recording(data, with, without)))
    gain = least;
  // Filters of a residual that still holds effects take a name for noise; who foretells what no fit saw is none.
  // A wave was looked for at many frequencies, and goes with anything that is slow.
  if (options.refuses && gain < margin && !noise.is_fed_back() && counted > 0.0 &&
      !is_sought(with.model.terms.back()) && foretold(data, with, without).is_plain())
    gain = std::max(gain, thresholds::foretold_margins * margin);
  // A further claim must be one that an engineer would see in the residual, or far beyond its price. A first one need
  // not, where the noise is loud at other frequencies, if it pays when counted in independent rows; nor in a loop, where
  // 200 machines that lacked nothing came nowhere near the margin.
  const double ratio = !options.refuses ? 1.0 : is_first ? thresholds::seen_first : thresholds::seen_further;
  const double beyond =
      is_sought(with.model.terms.back()) ? thresholds::wave_margins : thresholds::loop_margins;
  const bool pays =
      is_first ? counted > thresholds::claim_margin || (noise.is_fed_back() && gain > beyond * margin)
               : gain > margins_of_a_further(data, evidence, counted) * margin;
  const bool shows = pays || least_ratio(data, with, without) < ratio;
  if (!shows || (options.refuses && !stands(data, with, with.model.terms.size() - 1))) return {};
  // A law is judged with the noise that shakes it: a run without noise may be far off where the carriage sticks.
  const double rank =
      gain >= margin && has_rivals && noise.is_fed_back()
          ? evidence + noise.gain(with.model, without.model, own) - (without.data_cost - with.data_cost)
          : gain;
  return {OneName{0, own, std::move(with), std::move(without), gain}, rank};
}

}  // namespace

std::optional<OneName> leader(const Naming& naming, const Fit& base, const std::vector<Fit>& fits) {
  std::vector<std::size_t> leaders;
  std::set<std::string> tried;
  for (std::size_t i = 0; i < fits.size() && tried.size() < 3; ++i) {
    if (fits[i].evidence < base.evidence + 2.0) break;
    if (!tried.insert(label(fits[i].model.terms.back())).second) continue;
    if (fits[i].evidence < fits[0].evidence - 0.3 * (fits[0].evidence - base.evidence)) break;
    leaders.push_back(i);
  }
  std::vector<Followed> followed(leaders.size());
  in_parallel(leaders.size(), [&](std::size_t k) {
    followed[k] = follow(naming, base, fits[leaders[k]], leaders.size() > 1);
    if (followed[k].name) followed[k].name->place = leaders[k];
    if (!std::isfinite(followed[k].rank)) followed[k] = {};
  });
  auto best = std::max_element(followed.begin(), followed.end(),
                               [](const Followed& a, const Followed& b) { return a.rank < b.rank; });
  // Each was ranked under weights of its own residual; where one leaves plainly less in independent rows, it leads.
  for (auto other = followed.begin(); other != followed.end() && !naming.noise.is_fed_back(); ++other)
    if (other->name && best->name && other->name->gain >= naming.margin &&
        lead(naming.data, other->name->with, best->name->with) > thresholds::claim_margin)
      best = other;
  return best == followed.end() ? std::nullopt : std::move(best->name);
}

}  // namespace invar::diagnosis
