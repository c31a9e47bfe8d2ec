#include "core/diagnosis/evidence/form.hpp"

#include <algorithm>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::diagnosis {

std::string variable_of(const physics::Term& term) {
  if (!term.curve.over.empty()) return term.curve.over;
  if (term.info->is_steady) return "";
  return physics::goes_over(term);
}

bool is_over_time(const physics::Term& term) {
  return !term.curve.knots.empty() && (term.curve.over == "time" || term.curve.over == "t");
}

namespace {

/// Do two terms act at one place over one variable? Then the one is a course of the other, and one with a name.
bool are_kin(const physics::Term& one, const physics::Term& other) {
  const auto &a = one.info->depends_on, &b = other.info->depends_on;
  if (one.info->plant == physics::Plant::equations)
    return one.on == other.on && variable_of(one) == variable_of(other);
  return one.info->site == other.info->site && one.on == other.on &&
         std::any_of(a.begin(), a.end(), [&](std::string_view name) {
           return !name.empty() && std::find(b.begin(), b.end(), name) != b.end();
         });
}

}  // namespace

Start coarser(Start start, std::size_t knots) {
  auto& curve = start.term.curve;
  const double low = curve.knots.front(), high = curve.knots.back();
  curve.knots.clear();
  curve.values.assign(knots, 0.0);
  start.directions.clear();
  for (std::size_t k = 0; k < knots; ++k) {
    curve.knots.push_back(low + (high - low) * static_cast<double>(k) / static_cast<double>(knots - 1));
    start.directions.push_back({physics::most_parameters, k, false});
  }
  return start;
}

bool is_course_of(const physics::Term& curve, const physics::Term& term) {
  const auto& info = *term.info;
  if (info.plant == physics::Plant::equations)
    return curve.on == term.on && variable_of(curve) == variable_of(term);
  const auto site = info.site == "disturbance" ? std::string_view{"force"} : info.site;
  if (curve.info->site != site || (!curve.on.empty() && curve.on != term.on)) return false;
  return std::any_of(info.depends_on.begin(), info.depends_on.end(), [&](std::string_view name) {
    return curve.curve.over == (name == "temperature" ? physics::temperature_of(term) : name);
  });
}

std::optional<OtherForm> other_form(const Case& data, const Weighing& weighing, const Fit& base,
                                    const Fit& further) {
  // What goes with nothing, a steady force, is no course of what does: a curve would merely hold it as well.
  const auto& added = further.model.terms.back();
  if (data.model.plant == physics::Plant::equations ? variable_of(added).empty()
                                                    : added.info->depends_on.front().empty())
    return std::nullopt;
  std::vector<Start> starts;
  for (const auto& start : unmodelled_starts(data, base))
    for (std::size_t t = data.model.terms.size(); t < base.model.terms.size(); ++t)
      if (is_course_of(start.term, base.model.terms[t]) &&
          !are_kin(further.model.terms.back(), base.model.terms[t])) {
        for (const std::size_t knots : {4U, 8U})
          if (knots < start.directions.size()) starts.push_back(coarser(start, knots));
        if (start.directions.size() <= 14) starts.push_back(start);
        break;
      }
  if (starts.empty()) return std::nullopt;
  const auto screened = screen(data, weighing, base, starts, 2);
  std::optional<OtherForm> best;
  for (std::size_t i = 0; i < std::min<std::size_t>(2, screened.size()); ++i) {
    // To first order a curve gains all that it can: it is linear in its values.
    if (screened[i].merit < 0.0 || screened[i].columns.size() == 0) break;
    const Fit near = with_columns(data, base, screened[i]);
    const auto fitted = fit(data, weighing, near.model, data.model, Effort::follow(4), &near);
    if (fitted.evidence <= further.evidence || (best && fitted.evidence <= best->evidence)) continue;
    for (std::size_t t = data.model.terms.size(); t < base.model.terms.size(); ++t)
      if (is_course_of(screened[i].start.term, base.model.terms[t])) best = {t, fitted.evidence};
  }
  return best;
}

bool is_trifle(const Case& data, const Fit& retuned, const Fit& base, const Fit& further) {
  const auto all = squares_left(data, retuned.model), before = squares_left(data, base.model),
             after = squares_left(data, further.model);
  for (std::size_t o = 0; o < all.size(); ++o)
    if (before[o] - after[o] > thresholds::trifle_of_power * (all[o] - after[o])) return false;
  return true;
}

}  // namespace invar::diagnosis
