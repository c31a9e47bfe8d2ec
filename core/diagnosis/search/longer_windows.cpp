#include "core/diagnosis/search/longer_windows.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <utility>

#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/search/suspect.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// The recordings as they were judged, without their windows, for the best model in longer ones.
Case best_in_longer_windows(const Case& as_read, const Case& data, const Diagnosis& d) {
  auto longer = as_read;
  longer.model = d.best.model;
  std::erase_if(longer.model.parameters, is_start);
  for (std::size_t r = 0; r < longer.recordings.size(); ++r) {
    auto& recording = longer.recordings[r];
    recording.measured = data.recordings[r].measured;  // without what was judged an outlier
    recording.simulation = physics::prepare(longer.model, recording.inputs);
  }
  longer.windows = {};
  longer.windows.are_long = true;
  longer.stop = data.stop;
  longer.remembered = std::make_shared<Remembered>();
  cut_into_windows(longer);
  return longer;
}

/// What a model leaves of an output over the noise of its instrument: the largest of all outputs.
double most_over_noise(const Case& data, const physics::Model& model, const Diagnosis& d) {
  const auto simulated = simulate(data, model);
  double most = 0.0;
  for (std::size_t o = 0; o < data.outputs.size() && o < d.heldout.size(); ++o) {
    double squares = 0.0, rows = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (std::size_t i = 0; i < simulated[r][o].size(); ++i)
        if (const double left = data.recordings[r].measured[o][i] - simulated[r][o][i]; std::isfinite(left))
          squares += left * left, ++rows;
    if (rows > 0.0 && d.heldout[o].noise_floor > 0.0)
      most = std::max(most, std::sqrt(squares / rows) / d.heldout[o].noise_floor);
  }
  return most;
}

}  // namespace

void hold_to_longer_windows(const Case& as_read, Case& data, Diagnosis& d) {
  const bool leaves_nothing = d.verdict == Verdict::explained || d.verdict == Verdict::no_mismatch ||
                              d.verdict == Verdict::parameters_only;
  if (!leaves_nothing || !has_longer_windows(data)) return;
  const auto longer = best_in_longer_windows(as_read, data, d);
  if (longer.windows.count == 0 || longer.windows.length < 1.5 * data.windows.length) return;
  const auto plain = weigh(longer, simulate(longer, longer.model), Colour::white);
  const auto anew = fit(longer, plain, longer.model, longer.model, Effort::follow(8));
  const double times = most_over_noise(longer, anew.model, d);
  if (!(times > thresholds::times_noise)) return;
  if (d.findings.empty()) d.suspect = most_suspect(data, d);  // may be interrupted
  d.verdict = d.verdict == Verdict::explained ? Verdict::partly_explained : Verdict::unknown_physics;
  std::ostringstream text;
  text.precision(2);
  text << "in longer windows, of " << longer.windows.length << " s, the model errs by " << times
       << " times the noise: something slow is left";
  data.doubts.push_back(text.str());
}

}  // namespace invar::diagnosis
