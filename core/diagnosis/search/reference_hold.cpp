#include "core/diagnosis/search/reference_hold.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

namespace {

/// With a reference that goes on between the rows.
Case going_on(const Case& data) {
  Case other = data;
  other.remembered = std::make_shared<Remembered>();
  other.model.reference_goes_on = true;
  for (auto& recording : other.recordings)
    recording.simulation = physics::prepare(other.model, recording.inputs);
  return other;
}

/// Then there is nothing between the rows.
bool has_every_cycle(const Case& data) {
  const double rate = data.model.controller->rate;
  return std::all_of(data.recordings.begin(), data.recordings.end(), [rate](const Recording& recording) {
    const auto& time = recording.inputs.time;
    const auto cycle = [&](double t) { return std::lround((t - time.front()) * rate); };
    return std::adjacent_find(time.begin(), time.end(),
                              [&](double a, double b) { return cycle(b) > cycle(a) + 1; }) == time.end();
  });
}

/// Do the two say different things of the model as it is believed?
bool are_apart(const Case& a, const Case& b) { return simulate(a, a.model) != simulate(b, b.model); }

}  // namespace

void settle_hold(Case& data) {
  const auto& model = data.model;
  if (model.plant != physics::Plant::axis || !model.controller || model.reference_goes_on) return;
  if (has_every_cycle(data)) return;
  auto goes_on = going_on(data);
  if (!are_apart(data, goes_on)) return;
  const auto weighing = weigh(data, simulate(data, model), Colour::white);
  constexpr auto effort = Effort::follow(8);
  const auto held = fit(data, weighing, model, model, effort);
  const auto smooth = fit(goes_on, weighing, goes_on.model, goes_on.model, effort);
  // Numbers that are retuned make up for a reference that is off by a part of a row; as they are believed they do not.
  const auto off = [&](const Case& as) { return residual(as, weighing, as.model).squaredNorm(); };
  if (!(smooth.cost < held.cost - thresholds::claim_margin) || !(off(goes_on) < off(data))) return;
  data = std::move(goes_on);
  data.doubts.emplace_back(
      "not every cycle of the controller has its row, and between the rows its reference is taken to go "
      "on smoothly (`hold: smooth`), which lies nearer than `hold: step`");
}

}  // namespace invar::diagnosis
