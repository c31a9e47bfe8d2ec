#include "core/diagnosis/search/pairs.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>

#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/segments/excerpt.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// A fit and its scale settle together; every row counts alike.
struct Settled {
  Fit fit;
  Weighing weighing;
  double score = 0.0;  // log likelihood of all rows at the scale found, less the price of the numbers
};

Settled settle(const Case& data, Fit start, int rounds) {
  Settled s{std::move(start), {}, 0.0};
  for (int round = 0; round < rounds; ++round) {
    s.weighing = weigh(data, simulate(data, s.fit.model), Colour::white);
    auto nearer = fit(data, s.weighing, s.fit.model, data.model, Effort::follow(8), &s.fit);
    const bool arrived = least_ratio(data, nearer, s.fit) > 0.995;
    s.fit = std::move(nearer);
    if (arrived) break;
  }
  s.weighing = weigh(data, simulate(data, s.fit.model), Colour::white);
  double rows = 0.0;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double count = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      count += static_cast<double>(
          std::count(s.weighing.present[r][o].begin(), s.weighing.present[r][o].end(), true));
    s.score -= count * std::log(s.weighing.filters[o].sigma);
    rows += count;
  }
  s.score -= 0.5 * static_cast<double>(s.fit.free.size()) * std::log(std::max(10.0, rows));
  return s;
}

Fit begin(const Case& data, const Weighing& weighing, const Fit& base, const ScreenedPair& pair) {
  auto best = with(base, {&pair.first, &pair.second}, 0.15);  // stays where none gives numbers
  double least = 1e300;
  for (const double share : {1.0, 0.4, 0.15})
    for (const bool gives_way : {true, false}) {  // the other numbers, as they did to first order
      // Equations that swing answer in phase: first order goes far astray there.
      if (gives_way && data.model.plant == physics::Plant::equations) continue;
      auto tried = with(base, {&pair.first, &pair.second}, share);
      for (std::size_t k = 0; gives_way && k < base.free.size(); ++k) {
        const auto& f = base.free[k];
        set(tried, f, f.bounds.clamp(get(tried, f) + share * pair.shift(static_cast<Eigen::Index>(k))));
      }
      const double square = residual(data, weighing, tried).squaredNorm();
      if (square < least) least = square, best = std::move(tried);
    }
  return fit(data, weighing, best, data.model, Effort::follow(8), &base);
}

/// The single terms that do most to first order, each once, followed to their end.
std::vector<Settled> singles(const Case& data, const Weighing& plain, const Fit& under,
                             const std::set<std::string, std::less<>>& without) {
  constexpr std::size_t most = 5;
  const auto screened = screen(data, plain, under, named_starts(data, plain, under, without), 0);
  std::vector<const Screened*> best;
  std::set<std::string> seen;
  for (const auto& s : screened)
    if (best.size() < most && !s.impossible && seen.insert(label(s.start.term)).second) best.push_back(&s);
  std::vector<Settled> settled(best.size());
  in_parallel(settled.size(), [&](std::size_t i) {
    settled[i] = settle(data, fit_with(data, plain, under, *best[i], Effort::follow(8)), 3);
  });
  return settled;
}

/// Does a course over time, of the machine or of an instrument that drifts, do better than a pair?
bool drifts_alone(const Case& data, const Weighing& plain, const Fit& under, const Settled& pair) {
  constexpr std::size_t most = 2;
  auto starts = equation_curves(data, under.model);
  std::erase_if(starts, [](const Start& start) { return start.term.curve.over != "t"; });
  const auto screened = screen(data, plain, under, starts, most);
  for (std::size_t i = 0; i < std::min(most, screened.size()); ++i)
    if (lead(data, pair.fit,
             settle(data, fit_with(data, plain, under, screened[i], Effort::follow(8)), 3).fit) < 0.0)
      return true;
  return false;
}

/// Does one of them do as well as a pair?
bool is_done_by_one(const Case& data, const std::vector<Settled>& all, const Settled& pair) {
  return std::any_of(all.begin(), all.end(), [&](const Settled& one) {
    return lead(data, pair.fit, one.fit) < thresholds::claim_margin &&
           stands(data, one.fit, one.fit.model.terms.size() - 1);
  });
}

/// The pairs that gain most to first order, fitted, and the best of them followed to their end; best first.
std::vector<Settled> settled_pairs(const Case& data, const Weighing& plain, const Fit& under,
                                   const std::set<std::string, std::less<>>& without) {
  // A model of the user's own equations offers many terms of one kind, and is quick to simulate.
  const bool own = data.model.plant == physics::Plant::equations;
  const auto pairs =
      screen_pairs(data, plain, under, named_starts(data, plain, under, without), own ? 10 : 6);
  std::vector<Fit> rough(pairs.size());
  const auto some = excerpt(data, plain, under, 80 * rough.size());
  in_parallel(pairs.size(), [&](std::size_t i) {
    rough[i] = some ? on_all(data, plain, under, begin(some->data, some->weighing, some->base, pairs[i]))
                    : begin(data, plain, under, pairs[i]);
  });
  std::sort(rough.begin(), rough.end(), [](const auto& a, const auto& b) { return a.evidence > b.evidence; });
  // A motion that swings for long has narrow, bent valleys: where a run is quick, a fit is followed to its end.
  const int rounds = is_quick(data) ? 12 : 3;
  std::vector<Settled> settled(std::min<std::size_t>(3, rough.size()));
  in_parallel(settled.size(), [&](std::size_t i) { settled[i] = settle(data, std::move(rough[i]), rounds); });
  std::sort(settled.begin(), settled.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  return settled;
}

/// Keeps a model with one term, once of each label.
void keep(Pairs& found, const physics::Model& single) {
  if (std::none_of(found.alone.begin(), found.alone.end(), [&](const physics::Model& model) {
        return label(model.terms.back()) == label(single.terms.back());
      }))
    found.alone.push_back(single);
}

/// Are both terms needed, from place `first` on? An engineer must see what the other adds; a term that does without it is
/// kept alone.
bool needs_both(const Case& data, const Settled& best, std::size_t first, Pairs& found) {
  const bool one = stands(data, best.fit, first), two = stands(data, best.fit, first + 1);
  if (one != two) keep(found, physics::without_term(best.fit.model, one ? first + 1 : first));
  if (!one || !two) return false;
  bool needed = true;
  for (const std::size_t dropped : {first, first + 1}) {
    const auto alone = physics::without_term(best.fit.model, dropped);
    const auto single = settle(data, fit(data, best.weighing, alone, data.model, Effort::follow(8)), 3);
    const bool adds = least_ratio(data, best.fit, single.fit) < thresholds::pair_adds;
    if (!adds) keep(found, single.fit.model);
    needed = needed && adds;
  }
  return needed;
}

/// For each term of the pair, the terms that another pair has in its place beside the same other one.
std::vector<std::vector<physics::Term>> rivals_of(const Settled& best, const std::vector<Settled>& settled,
                                                  std::size_t first) {
  std::vector<std::vector<physics::Term>> rivals(2);
  for (const auto& other : settled) {
    if (&other == &best) continue;
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t k = 0; k < 2; ++k) {
        const auto &kept = best.fit.model.terms[first + 1 - i], &same = other.fit.model.terms[first + 1 - k];
        const auto &mine = best.fit.model.terms[first + i], &instead = other.fit.model.terms[first + k];
        if (label(kept) == label(same) && label(mine) != label(instead)) rivals[i].push_back(instead);
      }
  }
  return rivals;
}

/// The pair under weights of its own; nothing where it does not lead the base by what two claims need.
std::optional<JointClaim> claimed(const Case& data, const Fit& base, const Settled& best) {
  JointClaim claim;
  claim.weighing = weigh(data, simulate(data, best.fit.model));
  claim.fit = fit(data, claim.weighing, best.fit.model, data.model, Effort::follow(6), &best.fit);
  if (least_ratio(data, best.fit, claim.fit) < 0.9)
    claim.fit = fit(data, claim.weighing, best.fit.model, data.model, Effort::evaluate(), &best.fit);
  const auto neither = fit(data, claim.weighing, base.model, data.model, Effort::follow(6), &base);
  if (claim.fit.evidence - neither.evidence < 2.0 * claim_margin_of(claim.weighing)) return std::nullopt;
  return claim;
}

}  // namespace

bool is_quick(const Case& data) {
  return data.model.plant == physics::Plant::equations &&
         data.recordings.size() * data.recordings.front().inputs.rows() < thresholds::quick_rows;
}

Pairs claim_pair(const Case& data, const Fit& base, const std::set<std::string, std::less<>>& without,
                 const Fit* rival) {
  Pairs found;
  const bool own = data.model.plant == physics::Plant::equations;
  const Weighing plain = weigh(data, simulate(data, base.model), Colour::white);
  const Fit under = fit(data, plain, base.model, data.model, Effort::follow(4), &base);
  const auto settled = settled_pairs(data, plain, under, without);
  for (const auto& best : settled) {
    const std::size_t first = best.fit.model.terms.size() - 2;
    if (rival != nullptr && lead(data, best.fit, *rival) < thresholds::claim_margin) continue;
    if (first < data.model.terms.size() || !needs_both(data, best, first, found)) continue;
    // Two of the late outputs of a machine are one late input.
    if (rival == nullptr && is_done_by_one(data, singles(data, plain, under, without), best)) return found;
    if (own && rival == nullptr && drifts_alone(data, plain, under, best)) return found;
    auto claim = claimed(data, base, best);
    if (!claim) continue;
    claim->rivals = rivals_of(best, settled, first);
    found.claim = std::move(claim);
    return found;
  }
  if (!found.alone.empty() && rival == nullptr)  // others have their turn from the same numbers
    for (const auto& one : singles(data, plain, under, without)) keep(found, one.fit.model);
  return found;
}

std::vector<physics::Model> names_in_windows(const Case& data,
                                             const std::set<std::string, std::less<>>& without) {
  const auto cut = in_short_windows(data);
  if (!cut) return {};
  const auto plain = weigh(cut->data, simulate(cut->data, cut->fit.model), Colour::white);
  std::vector<physics::Model> models;
  for (auto& one : singles(cut->data, plain, cut->fit, without)) {
    std::erase_if(one.fit.model.parameters, is_start);
    models.push_back(std::move(one.fit.model));
  }
  return models;
}

}  // namespace invar::diagnosis
