#include "tools/diagnose/reference_hold.hpp"

#include <algorithm>

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

namespace {

Case with_hold(const Case& data, bool goes_on) {
  Case other = data;
  other.remembered = std::make_shared<Remembered>();
  other.model.reference_goes_on = goes_on;
  for (auto& recording : other.recordings)
    recording.simulation = physics::prepare(other.model, recording.inputs);
  return other;
}

/// Do the two say different things of the model as it is believed?
bool are_apart(const Case& a, const Case& b) { return simulate(a, a.model) != simulate(b, b.model); }

}  // namespace

void settle_hold(Case& data) {
  const auto& model = data.model;
  if (model.plant != physics::Plant::axis || !model.controller || model.reference_goes_on) return;
  auto goes_on = with_hold(data, true);
  if (!are_apart(data, goes_on)) return;
  const auto weighing = weigh(data, simulate(data, model), false);
  constexpr int steps = 8;
  const auto held = fit(data, weighing, model, model, steps);
  const auto smooth = fit(goes_on, weighing, goes_on.model, goes_on.model, steps);
  // Numbers that are retuned make up for a reference that is off by a part of a row; as they are believed they do not.
  const auto off = [&](const Case& as) { return residual(as, weighing, as.model).squaredNorm(); };
  if (!(smooth.cost < held.cost - claim_margin) || !(off(goes_on) < off(data))) return;
  data = std::move(goes_on);
  data.doubts.push_back(
      "not every cycle of the controller has its row, and between the rows its reference is taken to go "
      "on smoothly (`hold: smooth`), which lies nearer than `hold: step`");
}

}  // namespace invar::diagnose
