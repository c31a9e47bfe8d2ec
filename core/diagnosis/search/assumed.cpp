#include "core/diagnosis/search/assumed.hpp"

#include <algorithm>
#include <optional>
#include <set>

#include "core/base/fault.hpp"
#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

bool is_at(const Case& data, const physics::Term& term, const std::string& place) {
  return place.empty() || place == term.on || place == term.info->site || place == site_of(data, term);
}

/// The starts of one name, wherever it may act.
std::vector<Start> starts_of(const Case& data, const Weighing& weighing, const Fit& base,
                             const std::string& name) {
  std::set<std::string, std::less<>> others;
  for (const auto* info : physics::terms_of(data.model.plant))
    if (info->name != name) others.insert(std::string{info->name});
  return named_starts(data, weighing, base, others);
}

std::string listed(const std::set<std::string>& all) {
  std::string text;
  for (const auto& one : all) text += (text.empty() ? "" : ", ") + one;
  return text;
}

/// The nearest of the first few by first order, fitted to its end: all rows alike, then by the filters of what it leaves.
std::optional<std::pair<Fit, Weighing>> nearest(const Case& data, const Fit& base,
                                                const std::vector<Screened>& screened) {
  constexpr std::size_t tried = 4;
  std::optional<std::pair<Fit, Weighing>> best;
  for (std::size_t i = 0; i < std::min(tried, screened.size()); ++i) {
    auto weighing = weigh(data, simulate(data, base.model), Colour::white);
    auto fitted = fit_with(data, weighing, base, screened[i], Effort::follow(8));
    weighing = weigh(data, simulate(data, fitted.model), Colour::white);
    fitted = fit(data, weighing, fitted.model, data.model, Effort::follow(8), &fitted);
    // Filters that follow the colour of what is still missing may lead away.
    auto coloured = weigh(data, simulate(data, fitted.model));
    if (auto near = fit(data, coloured, fitted.model, data.model, Effort::follow(8), &fitted);
        least_ratio(data, fitted, near) > thresholds::leads_away)
      fitted = std::move(near), weighing = std::move(coloured);
    if (!best || least_ratio(data, fitted, best->first) < 1.0) best.emplace(fitted, weighing);
  }
  return best;
}

}  // namespace

Wanted wanted_of(const std::string& text) {
  const auto colon = text.find(':');
  return {text.substr(0, colon), colon == std::string::npos ? "" : text.substr(colon + 1)};
}

void check_wanted(const Case& data, const std::vector<Wanted>& wanted, const std::string& option) {
  Case begun = data;  // from rest a pendulum never moves, and nothing could act on it
  cut_into_windows(begun);
  const auto weighing = weigh(begun, simulate(begun, begun.model), Colour::white);
  const auto base = fit(begun, weighing, begun.model, begun.model, Effort::evaluate());
  for (const auto& [name, place] : wanted) {
    if (physics::find_term(data.model.plant, name) == nullptr) {
      std::set<std::string> names;
      for (const auto* info : physics::terms_of(data.model.plant)) names.insert(std::string{info->name});
      throw InputError{
          option, "`" + name + "` is no term of plant " + std::string{physics::name_of(data.model.plant)},
          "name one of " + listed(names)};
    }
    std::set<std::string> places;
    bool is_there = false;
    for (const auto& start : starts_of(begun, weighing, base, name)) {
      places.insert(start.term.on.empty() ? site_of(data, start.term) : start.term.on);
      is_there = is_there || is_at(data, start.term, place);
    }
    if (places.empty())
      throw InputError{option,
                       "`" + name + "` cannot act in these recordings, or stands in the model already",
                       "record the signals that it depends on, or name another term"};
    if (!is_there)
      throw InputError{option, "`" + name + "` does not act at `" + place + "`",
                       "name one of its places: " + listed(places)};
  }
}

std::vector<Assumed> fit_assumed(const Case& data, const Diagnosis& d, const std::vector<Wanted>& wanted) {
  std::vector<Assumed> all;
  for (const auto& [name, place] : wanted) {
    const auto weighing = weigh(data, simulate(data, d.retuned.model), Colour::white);
    const auto base = fit(data, weighing, d.retuned.model, data.model, Effort::evaluate());
    auto starts = starts_of(data, weighing, base, name);
    std::erase_if(starts, [&, &at = place](const Start& start) { return !is_at(data, start.term, at); });
    auto found = nearest(data, base, screen(data, weighing, base, starts, 0));
    if (!found) continue;
    Diagnosis alone = d;
    alone.best = std::move(found->first);
    alone.weighing = std::move(found->second);
    alone.is_unnamed = alone.has_rest = false;
    alone.heldout.clear();
    alone.train.clear();
    alone.findings.assign(1, {});
    alone.findings.front().term = alone.best.model.terms.back();
    hold_out(data, data, alone, Claims::kept);
    give_sigmas(data, alone);
    all.push_back({std::move(alone.findings.front()), std::move(alone.heldout)});
  }
  return all;
}

}  // namespace invar::diagnosis
