#include "core/diagnosis/search/unnamed.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/evidence/wander.hpp"
#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Model;

/// A dent or a step is narrow: the knots are gathered where the curve is not flat.
void sharpen(const Case& data, Curved& found) {
  auto& curved = found.fit;
  auto& weighing = found.weighing;
  const auto& curve = curved.model.terms.back().curve;
  if (curve.period > 0.0 || curve.memory != physics::Curve::Memory::none) return;  // it has its width
  const double level = median(curve.values);
  double top = 0.0;
  for (double v : curve.values) top = std::max(top, std::abs(v - level));
  std::size_t first = curve.knots.size(), last = 0;
  for (std::size_t k = 0; k < curve.knots.size(); ++k)
    if (std::abs(curve.values[k] - level) > 0.3 * top) first = std::min(first, k), last = k;
  if (first > last || (last - first + 3) * 2 > curve.knots.size()) return;
  const double spacing = curve.knots[1] - curve.knots[0];
  const double low = std::max(curve.knots.front(), curve.knots[first] - 1.2 * spacing),
               high = std::min(curve.knots.back(), curve.knots[last] + 1.2 * spacing);
  Model model = curved.model;
  auto& fine = model.terms.back().curve;
  fine.knots.clear(), fine.values.clear();
  constexpr int count = 18;
  for (int k = 0; k < count; ++k) {
    fine.knots.push_back(low + (high - low) * k / (count - 1));
    const bool is_force = model.terms.back().with.empty();  // friction and damping are everywhere
    fine.values.push_back(curve(fine.knots.back()) - (is_force ? level : 0.0));
  }
  auto rough = fit(data, weighing, model, data.model, Effort::follow(4));
  const Weighing own = weigh(data, simulate(data, rough.model));
  auto sharp = fit_near(data, own, rough, Effort::follow(4), thresholds::leads_a_curve_away);
  const auto blunt = fit(data, own, curved.model, data.model, Effort::polish(3), &curved);
  if (sharp.evidence < blunt.evidence || least_ratio(data, curved, sharp) < 0.97) return;
  found.gain += sharp.evidence - blunt.evidence;
  curved = std::move(sharp);
  weighing = own;
}

/// A motor that fades is nearly a load that grows: of the two, what explains more.
Fit load_or_motor(const Case& data, const Weighing& weighing, Fit load) {
  const auto& found = load.model.terms.back();
  if (found.info->plant != physics::Plant::axis || found.with != "acceleration") return load;
  auto model = load.model;
  auto& motor = model.terms.back();
  motor.info = physics::unmodelled(physics::Plant::axis, "actuator");
  motor.with.clear();
  for (double& value : motor.curve.values) value /= -model.value("mass", 1.0);
  auto faded = fit(data, weighing, model, data.model, Effort::follow(5));
  return faded.evidence > load.evidence ? faded : load;
}

/// Does every output lie within the noise that the user gave?
bool is_within_noise(const Case& data, const Fit& fit) {
  const auto simulated = simulate(data, fit.model);
  const auto left = squares_left(data, simulated, weigh(data, simulated, Colour::white));
  for (std::size_t o = 0; o < left.size(); ++o)
    if (!(left[o].rms() <= data.given_noise[o])) return false;
  return true;
}

/// Are the names three waves or more of one kind at one place? Those are the series of a curve.
bool is_series(const Model& model, std::size_t given) {
  constexpr std::ptrdiff_t waves = 3;
  const auto begin = model.terms.begin() + static_cast<std::ptrdiff_t>(given);
  return std::any_of(begin, model.terms.end(), [&](const physics::Term& one) {
    return one.info->index_of("phase") < physics::most_parameters &&
           std::count_if(begin, model.terms.end(), [&](const physics::Term& other) {
             return other.info == one.info && other.on == one.on;
           }) >= waves;
  });
}

/// Does what goes with time take over part of what a name explains? It follows anything slow, and the name's number would be wrong.
bool takes_over(const Model& named, const Model& with_course, std::size_t given) {
  constexpr double kept = 0.95;  // what a crowd of small effects does to a number
  for (std::size_t t = given; t < named.terms.size(); ++t)
    for (std::size_t i = 0; i < named.terms[t].info->parameter_count(); ++i)
      if (named.terms[t].info->parameters[i].role == physics::Role::amplitude &&
          std::abs(with_course.terms[t].values[i]) < kept * std::abs(named.terms[t].values[i]))
        return true;
  return false;
}

/// Would an engineer see it in the residual, or does it pay when counted in independent rows?
bool shows(const Case& data, const Fit& with, const Fit& without) {
  const double ratio = least_ratio(data, with, without);
  return ratio < thresholds::half_of_squares ||
         (ratio < thresholds::seen_beside &&
          lead(data, with, without) > thresholds::nameless_margins * thresholds::claim_margin);
}

/// A screened curve fitted beside the base; nothing where it does not pay.
std::optional<Curved> curved_by(const Case& data, const Fit& base, const Weighing& plain,
                                const Fit& under_plain, const Screened& s) {
  const double margin = claim_margin_of(plain);
  const Fit near = with_columns(data, under_plain, s);
  if (data.model.plant == physics::Plant::equations && !is_affordable(data, near)) return std::nullopt;
  auto rough = load_or_motor(data, plain, fit(data, plain, near.model, data.model, Effort::polish(2), &near));
  const Weighing own = weigh(data, simulate(data, rough.model));
  // Weights that take the slow part of what is left for noise judge a curve, but do not draw it.
  auto curved = fit_near(data, own, rough, Effort::polish(3), thresholds::leads_a_curve_away);
  const auto without = fit(data, own, base.model, data.model, Effort::follow(4), &base);
  const double evidence = curved.evidence - without.evidence;
  double gain = std::min(evidence, advantage_over_wander(data, own, curved, without));
  const auto& term = s.start.term;
  // Noise that wanders has a course over time too, but none in proportion to what the machine does.
  const bool may_wander = term.with.empty() && is_over_time(term);
  if (const double counted = lead(data, rough, under_plain);
      gain < thresholds::nameless_margins * margin &&
      std::min(evidence, counted) > thresholds::nameless_margins * margin && !may_wander) {
    if (goes_with_recording(data, rough, under_plain)) gain = std::min(evidence, counted);
  }
  // A course over time that takes little of the residual away must pay when counted in independent rows, and one that hardly
  // takes any is what such noise does.
  if (may_wander) {
    if (is_within_noise(data, under_plain)) return std::nullopt;
    const double left = least_ratio(data, rough, under_plain);
    if (left > thresholds::seen_further ||
        (left > thresholds::seen_beside &&
         lead(data, rough, under_plain) < thresholds::nameless_margins * thresholds::claim_margin))
      return std::nullopt;
  }
  return Curved{std::move(curved), own, gain};
}

/// Does a course beside friction leave plainly less than one in its place? Then it is friction's own rest.
bool is_needed_beside(const Case& data, const Curved& beside, const Curved& instead, const Diagnosis& d,
                      double margin) {
  const auto& terms = d.best.model.terms;
  return std::any_of(terms.begin() + static_cast<std::ptrdiff_t>(data.model.terms.size()), terms.end(),
                     [](const physics::Term& term) { return term.info->is_friction; }) &&
         beside.gain > margin && least_ratio(data, beside.fit, d.best) < thresholds::seen_beside &&
         lead(data, beside.fit, instead.fit) > margin;
}

}  // namespace

Curved best_curve(const Case& data, const Fit& base, const Beside& looked) {
  Curved best;
  for (const auto& s : looked.courses) {
    if (s.columns.size() == 0 || s.merit < thresholds::claim_margin) break;
    auto one = curved_by(data, base, looked.plain, looked.fit, s);
    // Filters of a residual that is not noise take nearly everything for noise: they judge a curve, but do not choose.
    if (one && one->gain > thresholds::claim_margin &&
        (best.gain < thresholds::claim_margin || lead(data, one->fit, best.fit) > 0.0))
      best = std::move(*one);
  }
  // What remembers is a filter of many numbers: it takes a little of nearly any dynamics that are not quite the machine's,
  // and drifts as an instrument does. It must leave far less than without it, and than a curve that remembers nothing.
  for (const auto& s : looked.memories) {
    if (s.columns.size() == 0 || s.merit < thresholds::claim_margin) break;
    auto one = curved_by(data, base, looked.plain, looked.fit, s);
    if (!one || !(one->gain > thresholds::claim_margin) ||
        least_ratio(data, one->fit, looked.fit) > thresholds::memory_leaves)
      continue;
    if (best.gain < thresholds::claim_margin ||
        least_ratio(data, one->fit, best.fit) < thresholds::memory_leaves_beside_curve)
      best = std::move(*one);
  }
  if (best.gain > thresholds::claim_margin) sharpen(data, best);
  return best;
}

bool leave_out_drift(const Case& data, Diagnosis& d) {
  const std::size_t given = data.model.terms.size();
  if (d.findings.size() < 2) return false;
  for (std::size_t i = d.findings.size(); i-- > 0;) {
    const auto drift = d.findings[i].term;
    if (drift.info->depends_on.front() != "time" || drift.info->index_of("phase") < physics::most_parameters)
      continue;
    const auto others = physics::without_term(d.best.model, given + i);
    auto without = fit(data, d.weighing, others, data.model, Effort::follow(10));
    if (!takes_over(without.model, others, given) || lead(data, d.best, without) > thresholds::claim_margin)
      continue;  // where it pays beside the others in independent rows too, it is needed
    d.reject(std::string{drift.info->name}, "it takes over what the others explain", d.findings[i].gain);
    d.best = std::move(without);
    d.findings.erase(d.findings.begin() + static_cast<std::ptrdiff_t>(i));
    return true;
  }
  return false;
}

bool takes_far_more(const Case& data, const Diagnosis& d, const Fit& curve) {
  const double all = squares_in_noise(data, d.retuned, d.best),
               by_names = all - squares_in_noise(data, d.best, d.best),
               by_curve = all - squares_in_noise(data, curve, d.best);
  return by_names < (1.0 - thresholds::of_form) * by_curve;
}

void name_friction_beside(const Case& data, Diagnosis& d, const std::set<std::string, std::less<>>& without) {
  // An axis is begun anew with two names at once where a course stands alone.
  if (data.model.plant != physics::Plant::equations || !d.is_unnamed || d.findings.size() != 1) return;
  const auto plain = weigh(data, simulate(data, d.best.model), Colour::white);
  const Fit base = fit(data, plain, d.best.model, data.model, Effort::follow(4), &d.best);
  auto starts = named_starts(data, plain, base, without);
  std::erase_if(starts, [&](const Start& start) {
    return !start.term.info->is_friction || !is_course_of(d.findings.front().term, start.term);
  });
  std::optional<Fit> best;
  for (const auto& s : screen(data, plain, base, starts, 0)) {
    if (s.impossible || s.merit < thresholds::claim_margin) continue;
    auto tried = fit_with(data, plain, base, s, Effort::follow(8));
    if (stands(data, tried, tried.model.terms.size() - 1) &&
        least_ratio(data, tried, base) < thresholds::seen_beside &&
        lead(data, tried, base) > thresholds::margins_of_a_trifle * thresholds::claim_margin &&
        (!best || lead(data, tried, *best) > 0.0))
      best = std::move(tried);
  }
  if (!best) return;
  auto& terms = best->model.terms;
  std::swap(terms[terms.size() - 2], terms.back());  // names before their rest
  d.weighing = weigh(data, simulate(data, best->model));
  d.best = fit(data, d.weighing, best->model, data.model, Effort::follow(5));
  d.findings.emplace(d.findings.begin())->term = d.best.model.terms[d.best.model.terms.size() - 2];
  d.findings.back().term = d.best.model.terms.back();
  d.is_unnamed = false, d.has_rest = true;
  d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
}

namespace {

/// A course in place of the names, where it explains far more than they do, and more than they do with one beside them.
void put_in_place(const Case& data, Diagnosis& d, const Curved& beside, const Beside& beside_best,
                  double margin) {
  const std::size_t given = data.model.terms.size();
  // What a curve in place of the names explains beyond them it would explain beside them too.
  if (std::none_of(beside_best.courses.begin(), beside_best.courses.end(),
                   [&](const Screened& s) { return s.gain > margin; }))
    return;
  auto instead = best_curve(data, d.retuned, courses_beside(data, d.retuned, &d.best));
  if (!(instead.gain > margin)) return;
  const auto named_there = fit(data, instead.weighing, d.best.model, data.model, Effort::follow(4), &d.best);
  const double lead_of_curve = instead.fit.evidence - named_there.evidence;
  if (!(lead_of_curve > margin) ||
      !(is_series(d.best.model, given) || lead_of_curve > thresholds::curve_over_name * instead.gain) ||
      !leaves_less(data, instead.fit, d.best) || is_needed_beside(data, beside, instead, d, margin))
    return;
  for (std::size_t t = given; t < d.best.model.terms.size(); ++t)
    d.reject(std::string{d.best.model.terms[t].info->name}, "a curve without a name explains far more", 1.0);
  d.best = std::move(instead.fit);
  d.weighing = std::move(instead.weighing);
  d.findings.clear();
  d.is_unnamed = true;
}

}  // namespace

void add_unnamed(const Case& data, Diagnosis& d, const Beside& beside_best) {
  const std::size_t given = data.model.terms.size();
  if (beside_best.courses.empty() && beside_best.memories.empty()) return;
  const bool named = d.best.model.terms.size() > given;
  const double margin = thresholds::nameless_margins * claim_margin_of(d.weighing);
  const double seen = named ? thresholds::seen_beside : thresholds::seen_alone;
  auto beside = best_curve(data, d.best, beside_best);
  if (named) put_in_place(data, d, beside, beside_best, margin);
  // A rest counts where an engineer would see it.
  if (!d.is_unnamed && beside.gain > margin &&
      !(is_over_time(beside.fit.model.terms.back()) && takes_over(d.best.model, beside.fit.model, given)) &&
      least_ratio(data, beside.fit, d.best) < seen) {
    d.best = std::move(beside.fit);
    d.weighing = std::move(beside.weighing);
    (named ? d.has_rest : d.is_unnamed) = true;
  }
  // What goes with two things at once is a course of neither.
  if (!named && !d.is_unnamed && data.model.plant == physics::Plant::equations)
    if (auto product = best_curve(data, d.best, products_beside(data, d.best));
        product.gain > margin && shows(data, product.fit, d.best)) {
      d.best = std::move(product.fit);
      d.weighing = std::move(product.weighing);
      d.is_unnamed = true;
    }
  if (!d.is_unnamed && !d.has_rest) return;
  const auto find_last = [&d] { d.findings.emplace_back().term = d.best.model.terms.back(); };
  find_last();
  // What moves a drop moves it in two directions, and an instrument may stand beside another.
  for (std::size_t more = 1; more < data.outputs.size() && !d.best.model.terms.back().on.empty(); ++more) {
    auto next = best_curve(data, d.best, courses_beside(data, d.best, &d.best));
    if (next.gain < margin || least_ratio(data, next.fit, d.best) > seen) break;
    const auto& terms = next.fit.model.terms;
    if (std::any_of(
            terms.begin() + static_cast<std::ptrdiff_t>(given), terms.end() - 1,
            [&](const auto& term) { return !term.curve.knots.empty() && term.on == terms.back().on; }))
      break;
    d.best = std::move(next.fit);
    d.weighing = std::move(next.weighing);
    find_last();
  }
  d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5), &d.retuned);
}

}  // namespace invar::diagnosis
