#include "tools/diagnose/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "tools/diagnose/left_over.hpp"
#include "tools/diagnose/other_cause.hpp"
#include "tools/diagnose/probability.hpp"

namespace invar::diagnose {

void hold_out(const Case& data, Diagnosis& d, bool refuses) {
  const std::size_t given = data.model.terms.size();
  // Every third stretch is kept from the fit; the simulation runs through, so its horizon is the whole recording.
  Weighing train = d.weighing, test = d.weighing;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const std::size_t rows = data.recordings[r].inputs.rows();
    const std::size_t stretch = std::max<std::size_t>(1, rows / 18);
    for (std::size_t o = 0; o < data.outputs.size(); ++o)
      for (std::size_t i = 0; i < rows; ++i) {
        const bool out = (i / stretch) % 3 == 1;
        (out ? train : test).present[r][o][i] = false;
      }
  }
  const auto retuned = fit(data, train, d.retuned.model, data.model, 3, &d.retuned);
  const auto after =
      d.best.model.terms.size() > given ? fit(data, train, d.best.model, data.model, 3, &d.best) : retuned;
  const auto nominal_out = simulate(data, data.model), retuned_out = simulate(data, retuned.model),
             after_out = simulate(data, after.model);
  const auto rms = [&](const std::vector<physics::Outputs>& simulated, std::size_t o, const Weighing& on) {
    double sum = 0.0;
    std::size_t n = 0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (std::size_t i = 0; i < data.recordings[r].inputs.rows(); ++i)
        if (on.present[r][o][i])
          sum += std::pow(data.recordings[r].measured[o][i] - simulated[r][o][i], 2), ++n;
    return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0.0;
  };
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto& signal = *data.model.signal(data.outputs[o]);
    FitRow row{signal.name,
               signal.unit == "degC" ? "K" : signal.unit,
               rms(nominal_out, o, test),
               rms(retuned_out, o, test),
               rms(after_out, o, test),
               0.0};
    FitRow trained{signal.name,
                   row.unit,
                   rms(nominal_out, o, train),
                   rms(retuned_out, o, train),
                   rms(after_out, o, train),
                   0.0};
    row.noise_floor = trained.noise_floor = std::isfinite(data.given_noise[o])
                                                ? data.given_noise[o]
                                                : std::min(row.after, d.weighing.filters[o].sigma);
    d.heldout.push_back(row);
    d.train.push_back(trained);
  }
  if (d.best.model.terms.size() == given || !refuses) return;
  // A claim must help on what it has not seen, counted in whitened residuals.
  const double gain =
      0.5 * d.weighing.temper *
      (residual(data, test, retuned_out).squaredNorm() - residual(data, test, after_out).squaredNorm());
  if (gain < 3.0) {
    for (const auto& finding : d.findings)
      d.reject(std::string{finding.term.info->name}, "no gain on held-out data",
               d.best.evidence - d.retuned.evidence);
    d.findings.clear();
    d.best = d.retuned;
    d.is_unnamed = d.has_rest = false;
    for (auto* rows : {&d.heldout, &d.train})
      for (auto& row : *rows) row.after = row.retuned;
  }
}

void smallest_effects(const std::vector<Screened>& screened, Diagnosis& d) {
  std::map<std::string, Detectable> smallest;
  for (const auto& s : screened) {
    const auto& info = *s.start.term.info;
    if (s.start.directions.empty() || s.start.directions[0].amplitude >= physics::most_parameters ||
        !(s.gain > 0.0))
      continue;
    const auto& p = info.parameters[s.start.directions[0].amplitude];
    double size = s.strength.norm();
    // The gain goes with the square of the strength: where it would just reach the margin.
    const double value = size * std::sqrt((claim_margin + 12.0) / s.gain);
    auto& entry = smallest[std::string{info.name}];
    if (entry.term.empty() || value < entry.value)
      entry = {std::string{info.name}, std::string{p.name}, std::string{p.unit}, value};
  }
  for (const auto& [name, entry] : smallest) d.detectable.push_back(entry);
}

namespace {

/// How much of the mismatch still follows what was recorded, beside what the best model explains of it: 0 to 1.
double share_left(const Case& data, const Diagnosis& d, const std::vector<double>& followed) {
  const auto best = simulate(data, d.best.model), retuned = simulate(data, d.retuned.model);
  double left = 0.0, won = 0.0;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double after = 0.0, before = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (std::size_t i = 0; i < best[r][o].size(); ++i)
        if (const double y = data.recordings[r].measured[o][i]; std::isfinite(y))
          after += std::pow(y - best[r][o][i], 2), before += std::pow(y - retuned[r][o][i], 2);
    if (!(after > 0.0)) continue;
    left += followed[o];
    won += std::max(0.0, before / after - 1.0);
  }
  return left > 0.0 ? left / (left + won) : 0.0;
}

}  // namespace

void conclude(const Case& data, Diagnosis& d) {
  const auto followed = followed_share(data, d.best.model);
  const double most_followed = *std::max_element(followed.begin(), followed.end());
  d.still_follows = share_left(data, d, followed);
  if (most_followed > 0.5) d.unexplained_over = {"history"};
  const std::size_t given = data.model.terms.size();
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    const std::size_t place = given + i;
    finding.term = d.best.model.terms[place];
    finding.sigmas.assign(finding.term.info->parameter_count(), 0.0);
    for (std::size_t k = 0; k < d.best.free.size(); ++k) {
      const auto& f = d.best.free[k];
      if (f.where == Freedom::Where::term && f.term == place)
        finding.sigmas[f.index] = d.best.sigma(static_cast<Eigen::Index>(k));
    }
    // What is lost without it.
    physics::Model without = d.best.model;
    without.terms.erase(without.terms.begin() + static_cast<std::ptrdiff_t>(place));
    const auto lost = residual(data, d.weighing, without).squaredNorm() - d.best.residual.squaredNorm();
    const auto all = residual(data, d.weighing, data.model).squaredNorm() - d.best.residual.squaredNorm();
    finding.share = all > 0.0 ? std::clamp(lost / all, 0.0, 1.0) : 0.0;
    double sum = 1.0;
    for (const auto& a : finding.alternatives) sum += std::exp(std::min(0.0, 0.5 * a.log_odds));
    const auto rival = fit(data, d.weighing, without, data.model, 5);
    finding.gain = std::min(d.best.evidence - rival.evidence, lead(data, d.best, rival));
    if (finding.term.curve.knots.empty()) sum += odds_of_another_cause(finding.gain, d.still_follows);
    finding.probability = std::min(0.995, 1.0 / sum);
  }
  for (std::size_t k = 0; k < d.best.free.size(); ++k) {
    const auto& f = d.best.free[k];
    if (f.where == Freedom::Where::curve || f.sigma <= 0.0) continue;
    d.parameter_excursion =
        std::max(d.parameter_excursion, std::abs(get(d.best.model, f) - f.center) / f.sigma);
  }
  d.nominal = fit(data, d.weighing, data.model, data.model, 0, &d.retuned);
  d.mismatch_gain = d.best.evidence - d.nominal.evidence;
  bool ambiguous = false;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives) ambiguous = ambiguous || a.log_odds > -ambiguous_margin;
  if (d.findings.empty())
    // What follows the recording is no noise, even where no curve and no name describes it.
    d.verdict = most_followed > 0.5           ? Verdict::unknown_physics
                : d.parameter_excursion > 3.0 ? Verdict::parameters_only
                                              : Verdict::no_mismatch;
  else if (d.is_unnamed)
    d.verdict = Verdict::unknown_physics;
  else if (ambiguous)
    d.verdict = Verdict::ambiguous;
  else
    d.verdict = d.has_rest || d.still_follows > 0.05 ? Verdict::partly_explained : Verdict::explained;
  double sum = 0.0;
  for (const auto& row : d.heldout) sum += row.noise_floor > 0.0 ? row.after / row.noise_floor : 1.0;
  d.unexplained = sum / static_cast<double>(std::max<std::size_t>(1, d.heldout.size()));
  std::sort(d.rejected.begin(), d.rejected.end(),
            [](const auto& a, const auto& b) { return a.gain > b.gain; });
  std::erase_if(d.rejected, [&](const Rejection& r) {
    return std::any_of(d.findings.begin(), d.findings.end(),
                       [&](const Finding& f) { return f.term.info->name == r.term; });
  });
}

}  // namespace invar::diagnose
