#include "core/diagnosis/evidence/other_cause.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/diagnosis/candidates/burst.hpp"
#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

Lead lead_of(const Case& data, const Left& one, const Left& other) {
  Lead all;
  for (std::size_t o = 0; o < one.size(); ++o) {
    double with = 0.0, without = 0.0, rows = 0.0;
    for (std::size_t r = 0; r < one[o].size(); ++r)
      for (std::size_t i = 0; i < one[o][r].size(); ++i)
        if (const double e = one[o][r][i], f = other[o][r][i]; std::isfinite(e) || std::isfinite(f)) {
          if (std::isfinite(e)) with += e * e, rows += 0.5;
          if (std::isfinite(f)) without += f * f, rows += 0.5;
        }
    if (!(with > 0.0) || !(without > 0.0)) continue;
    // The smaller residual is nearer to the noise, and so is its colour.
    const double worth =
        rows * (data.is_time_series ? independent_share(with < without ? one[o] : other[o]) : 1.0);
    all.ratio = std::min(all.ratio, std::sqrt(with / without));
    all.gain += 0.5 * worth * std::log(without / with);
    all.independent += worth;
  }
  return all;
}

double lead(const Case& data, const Fit& one, const Fit& other) {
  const auto left_by = [&](const Fit& fit) {
    const auto simulated = simulate(data, fit.model);
    Left left(data.outputs.size());
    for (std::size_t o = 0; o < left.size(); ++o)
      for (std::size_t r = 0; r < data.recordings.size(); ++r) {
        auto& e = left[o].emplace_back(data.recordings[r].measured[o]);
        for (std::size_t i = 0; i < e.size(); ++i) e[i] -= simulated[r][o][i];
      }
    return left;
  };
  const auto all = lead_of(data, left_by(one), left_by(other));
  return all.gain - 0.5 * (static_cast<double>(one.free.size()) - static_cast<double>(other.free.size())) *
                        std::log(std::max(10.0, all.independent));
}

double advantage(const Case& data, const Weighing& weighing, const Fit& one, const Fit& other) {
  const double evidence = one.evidence - other.evidence;
  const bool whitened =
      !data.is_time_series || std::any_of(weighing.filters.begin(), weighing.filters.end(),
                                          [](const Whitening& filter) { return !filter.a.empty(); });
  if (whitened) return evidence;
  const double counted = lead(data, one, other) + other.unlikely - one.unlikely;
  return std::abs(counted) < std::abs(evidence) ? counted : evidence;
}

double margins_of_a_further(const Case& data, double evidence, double counted) {
  return !data.model.controller && is_white(evidence, counted) ? thresholds::white_margins
                                                               : thresholds::margins_of_a_trifle;
}

namespace {

/// Of what `course` explains of the residual of `base`, the share of the power that `named` leaves. Terms are idealised:
/// the machine's own form of one may well differ by a few percent.
double lost_share(const Case& data, const Fit& base, const Fit& named, const Fit& course) {
  const auto b = squares_left(data, base.model), n = squares_left(data, named.model),
             c = squares_left(data, course.model);
  double lost = 0.0, all = 0.0;
  for (std::size_t o = 0; o < c.size(); ++o)
    if (c[o] > 0.0) lost += n[o] / c[o] - 1.0, all += b[o] / c[o] - 1.0;
  return all > 0.0 ? lost / all : 0.0;
}

}  // namespace

namespace {

Beside beside(const Case& data, const Fit& best,
              const std::function<std::vector<Start>(const Fit& under_plain)>& starts) {
  Beside one;
  one.plain = weigh(data, simulate(data, best.model), Colour::white);
  one.fit = fit(data, one.plain, best.model, data.model, Effort::follow(4), &best);
  one.courses = screen(data, one.plain, one.fit, starts(one.fit), tried_curves);
  return one;
}

}  // namespace

Beside courses_beside(const Case& data, const Fit& best, const Fit* spanned) {
  auto one = beside(data, best, [&](const Fit& under_plain) {
    const auto& like = spanned != nullptr ? *spanned : under_plain;
    auto starts = unmodelled_starts(data, like);
    // What the wrong form of a name leaves comes in bursts too, wherever the machine moves.
    if (like.model.terms.size() == data.model.terms.size())
      for (auto& burst : burst_starts(data, like)) starts.push_back(std::move(burst));
    return starts;
  });
  const auto& like = spanned != nullptr ? *spanned : one.fit;
  one.memories = screen(data, one.plain, one.fit, memory_starts(data, like), tried_curves);
  return one;
}

Beside products_beside(const Case& data, const Fit& best) {
  return beside(data, best,
                [&](const Fit&) { return equation_curves(data, best.model, Curves::times_a_variable); });
}

std::optional<OtherCause> other_cause(const Case& data, const Beside& beside, std::size_t term) {
  const auto& [plain, named, courses, memories] = beside;
  if (courses.empty() || courses[0].merit < thresholds::claim_margin || courses[0].columns.size() == 0)
    return std::nullopt;
  const Fit base = fit(data, plain, physics::without_term(named.model, term), data.model, Effort::follow(6));
  // In place of a law of friction a course of it along the way is a cause of its own, which beside the law is none.
  const auto starts = unmodelled_starts(data, data.model.plant == physics::Plant::axis ? base : named);
  const auto instead = screen(data, plain, base, starts, 4);
  std::optional<OtherCause> found;
  for (const auto& s : instead) {
    if (s.merit < thresholds::claim_margin || s.columns.size() == 0) break;
    const Fit start = with_columns(data, base, s);
    if (data.model.plant == physics::Plant::equations && !is_affordable(data, start)) continue;
    OtherCause one;
    one.fit = fit(data, plain, start.model, data.model, Effort::follow(4), &start);
    one.lead = lead(data, one.fit, named);
    // Another course over the term's own variable is a matter of form, unless next to nothing is left of the name.
    // Friction need not be the same everywhere to be friction. What a state beside it passes on comes to the same.
    const bool is_form = is_course_of(s.start.term, named.model.terms[term]) ||
                         (data.model.plant == physics::Plant::equations &&
                          variable_of(s.start.term) == variable_of(named.model.terms[term])) ||
                         (s.start.term.with == "direction" && named.model.terms[term].info->is_friction);
    if (one.lead < thresholds::claim_margin ||
        lost_share(data, base, named, one.fit) < (is_form ? thresholds::of_form : 0.02))
      continue;
    if (!leaves_less(data, one.fit, named)) continue;
    if (!found || one.lead > found->lead) found = std::move(one);
  }
  return found;
}

}  // namespace invar::diagnosis
