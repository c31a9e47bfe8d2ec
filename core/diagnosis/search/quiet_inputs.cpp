#include "core/diagnosis/search/quiet_inputs.hpp"
#include "core/diagnosis/thresholds.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace invar::diagnosis {

namespace {

std::vector<double> running_median(const std::vector<double>& values, std::size_t reach) {
  std::vector<double> quiet(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t by = std::min({reach, i, values.size() - 1 - i});  // one-sided, it would lead or trail
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(i);
    const auto to = static_cast<std::ptrdiff_t>(by);
    quiet[i] = std::isfinite(values[i]) ? median({at - to, at + to + 1}) : values[i];
  }
  return quiet;
}

/// Is what the medians take off the inputs noise, which comes anew in each row? A median that is long beside the motion takes
/// the motion itself.
bool takes_noise_alone(const Case& data, const Case& quiet) {
  for (const auto& signal : data.model.signals) {
    std::vector<std::vector<double>> taken;
    bool any = false;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto* was = data.recordings[r].inputs.find(signal.name);
      const auto* now = quiet.recordings[r].inputs.find(signal.name);
      if (signal.is_output || was == nullptr || now == nullptr) continue;
      auto& one = taken.emplace_back(*was);
      for (std::size_t i = 0; i < one.size(); ++i) one[i] -= (*now)[i], any = any || one[i] > 0.0;
    }
    if (any && independent_share(taken) < thresholds::input_noise_anew) return false;
  }
  return true;
}

Case quietened(const Case& data, std::size_t reach) {
  auto quiet = data;
  quiet.quiet_rows = 2 * reach + 1;
  for (auto& recording : quiet.recordings) {
    for (const auto& signal : data.model.signals) {
      const auto at = recording.inputs.signals.find(signal.name);
      if (!signal.is_output && signal.name != "time" && at != recording.inputs.signals.end())
        at->second = running_median(at->second, reach);
    }
    recording.simulation = physics::prepare(quiet.model, recording.inputs);
  }
  return quiet;
}

/// What each claim gains, in log evidence.
std::vector<double> gains(const Case& data, const Diagnosis& d) {
  const auto best = fit(data, d.weighing, d.best.model, data.model, Effort::follow(5));
  std::vector<double> all;
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const auto without = physics::without_term(best.model, data.model.terms.size() + i);
    all.push_back(best.evidence - fit(data, d.weighing, without, data.model, Effort::follow(5)).evidence);
  }
  return all;
}

/// Physics gains about as much where the inputs are quiet; what made up for their noise does not.
bool all_stand(const Case& judged, const Case& quiet, const Diagnosis& d) {
  const auto noisy = gains(judged, d), now = gains(quiet, d);
  const double margin = claim_margin_of(d.weighing);
  for (std::size_t i = 0; i < now.size(); ++i)
    if (now[i] < std::max(margin, 0.5 * noisy[i])) return false;
  return true;
}

}  // namespace

std::optional<Case> with_quiet_inputs(const Case& as_read, const Case& judged, const Diagnosis& d) {
  // A set point is known, and so is what a loop does with it.
  const auto& model = judged.model;
  const bool is_open = !physics::states_of(model).empty() && model.equations.controlled_input.empty();
  if (!is_open || d.findings.empty() || d.is_partial) return std::nullopt;
  const double margin = claim_margin_of(d.weighing);
  std::optional<Case> quiet;
  std::size_t reach = 0;
  double cost = d.retuned.cost - margin;
  for (const std::size_t tried : {1U, 2U, 4U, 8U, 16U}) {
    auto other = quietened(judged, tried);
    if (!takes_noise_alone(judged, other)) break;
    const double now = fit(other, d.weighing, d.retuned.model, model, Effort::evaluate()).cost;
    if (!(now < cost)) continue;
    cost = now, reach = tried;
    quiet = std::move(other);
  }
  if (!quiet || all_stand(judged, *quiet, d)) return std::nullopt;
  auto again = quietened(as_read, reach);
  // A median over n rows leaves pi / (2 n) of the power of white noise.
  const double left = 0.5 * std::numbers::pi / static_cast<double>(again.quiet_rows);
  again.left_of_inputs = left / (1.0 - left) * (d.retuned.cost - cost);
  return again;
}

}  // namespace invar::diagnosis
