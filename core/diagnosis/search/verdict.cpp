#include "core/diagnosis/search/verdict.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/block_sigma.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/search/suspect.hpp"
#include "core/diagnosis/search/unsure.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// One fold: every row of a third of the stretches is kept from the fit; the simulation runs through, so its horizon is
/// the whole recording.
constexpr std::size_t folds = 3, stretches = 18;

struct Fold {
  Weighing train, test;
};

Fold fold_of(const Case& data, const Weighing& all, std::size_t which) {
  Fold fold{all, all};
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& inputs = data.recordings[r].inputs;
    // Within a window of its own states some rows must be left to find these by.
    const std::size_t count = std::max(stretches, 4 * (inputs.restarts.size() + 1));
    const std::size_t least = std::max<std::size_t>(1, inputs.rows() / count);
    auto restart = inputs.restarts.begin();
    std::size_t begin = 0, stretch = least, first = 0;
    for (std::size_t i = 0; i < inputs.rows(); ++i) {
      if (restart != inputs.restarts.end() && *restart == i) {
        begin = i;
        const auto end = ++restart == inputs.restarts.end() ? inputs.rows() : *restart;
        stretch = std::max<std::size_t>(1, std::min(least, (end - begin) / 4));
        // What fades within a few rows is not to be known from later ones, so its beginning is not asked for.
        first = 1;
      }
      const std::size_t at = (i - begin) / stretch;
      const bool tested = at >= first && (at - first) % folds == which;
      for (std::size_t o = 0; o < data.outputs.size(); ++o)
        (tested ? fold.train : fold.test).present[r][o][i] = false;
    }
  }
  return fold;
}

/// The weights under which this model is the best of its kind: coloured ones may follow the colour of what is still
/// missing and lead away from it; then every row counts alike.
Weighing weights_of(const Case& data, const Weighing& coloured, const Fit& whole) {
  const auto again = fit(data, coloured, whole.model, data.model, 6, &whole);
  return least_ratio(data, whole, again) < 0.97 ? weigh(data, simulate(data, whole.model), false) : coloured;
}

/// How many rows of what a model leaves are independent, as a share of them: of the output that has the least.
double independent_share_of(const Case& data, const std::vector<physics::Outputs>& simulated) {
  double share = 1.0;
  for (std::size_t o = 0; data.is_time_series && o < data.outputs.size(); ++o) {
    std::vector<std::vector<double>> left;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      auto& one = left.emplace_back(data.recordings[r].measured[o]);
      for (std::size_t i = 0; i < one.size(); ++i) one[i] -= simulated[r][o][i];
    }
    share = std::min(share, independent_share(left));
  }
  return share;
}

/// The weights for a model that lacks something. What it leaves is no noise, whatever its colour, and goes on from row to row:
/// counted in every one of them, a part of the recording would outweigh what the user believes, and lead astray elsewhere.
Weighing weights_of_rival(const Case& data, const Fit& whole) {
  const auto simulated = simulate(data, whole.model);
  auto weights = weigh(data, simulated, false);
  weights.temper *= independent_share_of(data, simulated);
  return weights;
}

/// The model fitted anew without the held-out rows. It begins where the whole recording put it: what is asked is whether
/// the model holds where it was not fitted, not whether the search finds it again.
Fit refitted(const Case& data, const Weighing& weights, std::size_t fold, const Fit& whole, int iterations) {
  const auto train = fold_of(data, weights, fold).train;
  return fit(data, train, whole.model, data.model, iterations, &whole);
}

/// A free course knows nothing of a place that the rows of a fold never came to, and whoever asks it there gets whatever the
/// last rows beside it leave open; so does a state of what it began at, once the rows that would say so are kept back. Rows
/// that a fit leaves more open than their noise is, by its courses or by its beginnings, are not asked for.
void ask_what_is_known(const Case& data, const Fit& fold_fit, bool is_curved, Weighing& test) {
  std::vector<Eigen::Index> beginnings;
  for (std::size_t k = 0; k < fold_fit.free.size(); ++k)
    if (const auto& f = fold_fit.free[k];
        f.where == Freedom::Where::parameter && is_initial(fold_fit.model.parameters[f.index]))
      beginnings.push_back(static_cast<Eigen::Index>(k));
  if (!is_curved && beginnings.empty()) return;
  const Eigen::MatrixXd known = whitened(data, test, fold_fit.columns);
  Eigen::VectorXd open = (known * fold_fit.covariance).cwiseProduct(known).rowwise().sum();
  if (!is_curved) {
    const Eigen::MatrixXd begun = known(Eigen::all, beginnings);
    open = open.cwiseMin(
        (begun * fold_fit.covariance(beginnings, beginnings)).cwiseProduct(begun).rowwise().sum());
  }
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto rows = static_cast<Eigen::Index>(data.recordings[r].inputs.rows());
    for (Eigen::Index i = 0; i < rows; ++i) {
      double most = 0.0;
      for (std::size_t o = 0; o < data.outputs.size(); ++o)
        most = std::max(most, open(at + static_cast<Eigen::Index>(o) * rows + i));
      if (most <= 1.0) continue;
      for (std::size_t o = 0; o < data.outputs.size(); ++o)
        test.present[r][o][static_cast<std::size_t>(i)] = false;
    }
    at += rows * static_cast<Eigen::Index>(data.outputs.size());
  }
}

}  // namespace

void hold_out(const Case& data, const Case& recorded, Diagnosis& d, bool refuses) {
  const std::size_t given = data.model.terms.size();
  const bool any = d.best.model.terms.size() > given;
  const auto nominal = simulate(data, data.model);
  const auto for_retuned = d.is_partial ? d.weighing : weights_of(data, d.weighing, d.retuned);
  const auto for_best = any && !d.is_partial ? weights_of(data, d.weighing, d.best) : for_retuned;
  const int iterations = d.is_partial ? 1 : 6;  // who stopped it does not want to wait
  // A claim must win by the weights of what it leaves itself; shown is the rival by those that suit it.
  const bool differs = any && !d.is_partial;
  const auto for_rival = differs ? weights_of_rival(data, d.retuned) : for_retuned;
  struct Sums {
    Squares before, retuned, after;
  };
  std::vector<Sums> tested(data.outputs.size()), trained(data.outputs.size());
  struct Runs {
    Fold fold;
    std::vector<physics::Outputs> retuned, after, rival;
  };
  std::array<Runs, folds> runs;
  in_parallel(folds, [&](std::size_t k) {
    auto& [fold, retuned, after, rival] = runs[k];
    fold = fold_of(data, d.weighing, k);
    const auto fitted = refitted(data, for_retuned, k, d.retuned, iterations);
    after = retuned = simulate(data, fitted.model);
    if (any) {
      const auto best = refitted(data, for_best, k, d.best, iterations);
      ask_what_is_known(data, best, d.is_unnamed || d.has_rest, fold.test);
      after = simulate(data, best.model);
    } else {
      ask_what_is_known(data, fitted, false, fold.test);
    }
    rival = differs ? simulate(data, refitted(data, for_rival, k, d.retuned, 3).model) : retuned;
  });
  double gain = 0.0, over_given = 0.0;  // of what was not seen, in whitened residuals
  for (const auto& [fold, retuned, after, rival] : runs) {
    for (const bool test : {true, false}) {
      const auto& on = test ? fold.test : fold.train;
      auto& sums = test ? tested : trained;
      const auto before = squares_left(recorded, nominal, on), without = squares_left(recorded, rival, on),
                 with = squares_left(recorded, after, on);
      for (std::size_t o = 0; o < sums.size(); ++o)
        sums[o].before += before[o], sums[o].retuned += without[o], sums[o].after += with[o];
    }
    if (!any) continue;
    const auto beyond_best = [&, &on = fold.test, &best = after](const std::vector<physics::Outputs>& other) {
      return 0.5 * d.weighing.temper *
             (residual(data, on, other).squaredNorm() - residual(data, on, best).squaredNorm());
    };
    gain += beyond_best(retuned);
    over_given += beyond_best(nominal);
  }
  std::vector<double> noise;
  const auto simulated = simulate(recorded, d.best.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o)
    noise.push_back(instrument_noise(recorded, simulated, o));
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto& signal = *data.model.signal(data.outputs[o]);
    const auto row = [&](const Sums& sums) {
      return FitRow{signal.name,       signal.unit == "degC" ? "K" : signal.unit,
                    sums.before.rms(), sums.retuned.rms(),
                    sums.after.rms(),  0.0};
    };
    d.heldout.push_back(row(tested[o]));
    d.train.push_back(row(trained[o]));
    d.heldout.back().noise_floor = d.train.back().noise_floor =
        std::isfinite(data.given_noise[o]) ? data.given_noise[o] : std::min(d.heldout.back().after, noise[o]);
  }
  if (!refuses) return;
  // Numbers that lead away from what was not seen are not taken over.
  const auto errs_more = [&](OfModel one, OfModel than) {
    constexpr double enough = 8.0;  // readings; a start value alone is compared with nothing
    std::vector<FitRow> compared;
    for (std::size_t o = 0; o < tested.size(); ++o)
      if (tested[o].before.count >= enough) compared.push_back(d.heldout[o]);
    return is_worse(compared, one, than);
  };
  if (errs_more(&FitRow::retuned, &FitRow::before)) {
    d.retuned = fit(data, d.weighing, data.model, data.model, 0);
    gain = over_given;
    for (auto* rows : {&d.heldout, &d.train})
      for (auto& row : *rows) row.retuned = row.before;
    if (!any) {
      d.best = d.retuned;
      for (auto* rows : {&d.heldout, &d.train})
        for (auto& row : *rows) row.after = row.before;
    }
  }
  if (!any) return;
  // A claim must help on what it has not seen. Where a loop feeds noise back a run without noise may lie farther off.
  const bool is_loop = data.model.controller || !data.model.equations.controlled_input.empty();
  const bool is_nearer = std::any_of(d.heldout.begin(), d.heldout.end(),
                                     [](const FitRow& row) { return row.after < row.retuned; });
  const bool misleads = errs_more(&FitRow::after, &FitRow::retuned);
  if (misleads && d.findings.size() > 1) {  // what was found last is the least of it
    take_last_back(data, d, "with it the model is worse on held-out data");
    d.heldout.clear();
    d.train.clear();
    hold_out(data, recorded, d, refuses);
    return;
  }
  if (gain < 3.0 || misleads || !(is_loop || is_nearer)) {
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

namespace {

/// The share that a name leaves of what was there to explain beyond the noise; `rival`: the model without it, fitted anew.
double rest_left_by(const Case& data, const Fit& best, const Fit& rival, const std::vector<double>& excess) {
  const auto with = squares_left(data, best.model), without = squares_left(data, rival.model);
  std::vector<double> won(excess.size(), 0.0);
  for (std::size_t o = 0; o < won.size(); ++o)
    if (with[o] > 0.0) won[o] = (without[o] / with[o] - 1.0) * (1.0 + excess[o]);
  return rest_beside(won, excess);
}

/// How much of the mismatch still follows what was recorded, beside what the best model explains of it: 0 to 1.
double share_left(const Case& data, const Diagnosis& d, const std::vector<double>& followed) {
  const auto after = squares_left(data, d.best.model), before = squares_left(data, d.retuned.model);
  double left = 0.0, won = 0.0;
  for (std::size_t o = 0; o < after.size(); ++o) {
    if (!(after[o] > 0.0)) continue;
    left += followed[o];
    won += std::max(0.0, before[o] / after[o] - 1.0);
  }
  return left > 0.0 ? left / (left + won) : 0.0;
}

/// What the best model leaves, over what of it is not related from row to row (over the noise that the user gave): the mean of
/// the outputs. How sure a name is was learnt by this measure.
double times_unrelated(const Case& data, const Diagnosis& d) {
  double sum = 0.0;
  for (std::size_t o = 0; o < d.heldout.size(); ++o) {
    const double after = d.heldout[o].after, given = data.given_noise[o],
                 noise = std::isfinite(given) ? given : std::min(after, d.weighing.filters[o].sigma);
    sum += noise > 0.0 ? after / noise : 1.0;
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, d.heldout.size()));
}

/// More than twice what the instruments add is mismatch, whatever its colour.
void keep_to_noise(const Case& data, Diagnosis& d) {
  if (!(most_over_noise(d) > times_noise)) return;
  if (d.verdict == Verdict::explained) d.verdict = Verdict::partly_explained;
  if (d.verdict != Verdict::no_mismatch && d.verdict != Verdict::parameters_only) return;
  d.verdict = Verdict::unknown_physics;
  d.suspect = most_suspect(data, d);
}

}  // namespace

void give_sigmas(const Case& data, Diagnosis& d) {
  if (!d.is_partial) d.best.sigma = sigma_over_blocks(data, d.weighing, d.best);
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    const std::size_t place = data.model.terms.size() + i;
    finding.term = d.best.model.terms[place];
    finding.sigmas.assign(finding.term.info->parameter_count(), 0.0);
    for (std::size_t k = 0; k < d.best.free.size(); ++k) {
      const auto& f = d.best.free[k];
      if (f.where == Freedom::Where::term && f.term == place)
        finding.sigmas[f.index] = d.best.sigma(static_cast<Eigen::Index>(k));
    }
  }
}

void conclude(const Case& data, Diagnosis& d) {
  auto followed = followed_share(data, d.best);
  // Beside a name that is right little is left; without one, noise may wander far.
  const auto far = far_share(data, d.best, d.findings.empty() ? 5.0 : 3.0);
  for (std::size_t o = 0; o < far.size(); ++o) followed[o] = std::max(followed[o], far[o]);
  const double most_followed = *std::max_element(followed.begin(), followed.end());
  d.still_follows = share_left(data, d, followed);
  // Where nothing is missing no more than a hundredth did in 150 recordings of machines made by two authors.
  constexpr double plainly_followed = 0.1;
  if (most_followed > plainly_followed) d.unexplained_over = {"history"};
  // A user who writes down his equations and his noise has said what a model that is whole leaves.
  const auto excess = data.model.plant == physics::Plant::equations
                          ? excess_over_noise(data, d.best)
                          : std::vector<double>(data.outputs.size(), 0.0);
  d.parameter_excursion = excursion_of(d.best);
  give_sigmas(data, d);
  std::vector<double> rests;
  const std::size_t given = data.model.terms.size();
  const auto beyond_best = [&](const physics::Model& model) {
    return residual(data, d.weighing, model).squaredNorm() - d.best.residual.squaredNorm();
  };
  const double mismatch = d.findings.empty() ? 0.0 : beyond_best(data.model),
               rest_of_retuned = d.findings.empty() ? 0.0 : beyond_best(d.retuned.model);
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    auto& finding = d.findings[i];
    const std::size_t place = given + i;
    // What is lost without it.
    const auto without = physics::without_term(d.best.model, place);
    const double lost = beyond_best(without);
    const auto share_of = [&](double all) { return all > 0.0 ? std::clamp(lost / all, 0.0, 1.0) : 0.0; };
    finding.share = share_of(mismatch);
    finding.share_of_rest = std::max(finding.share, share_of(rest_of_retuned));
    const auto rival = fit(data, d.weighing, without, data.model, d.is_partial ? 1 : 5);
    finding.gain = std::min(d.best.evidence - rival.evidence, lead(data, d.best, rival));
    const double rest = rest_left_by(data, d.best, rival, excess);
    rests.push_back(rest);
    weigh_name(data, d, place, rest, finding);
  }
  d.nominal = fit(data, d.weighing, data.model, data.model, 0, &d.retuned);
  d.mismatch_gain = d.best.evidence - d.nominal.evidence;
  d.unexplained = d.heldout.empty() ? 1.0 : 0.0;
  for (const auto& row : d.heldout)
    d.unexplained = std::max(d.unexplained, row.noise_floor > 0.0 ? row.after / row.noise_floor : 1.0);
  const double beyond_unrelated = times_unrelated(data, d);
  constexpr double far_above = 0.5;  // of the power of the noise that the user gave
  constexpr double times_the_noise = 3.0;
  leave_unsaid(d, rests,
               *std::max_element(excess.begin(), excess.end()) > far_above ||
                   (data.model.plant == physics::Plant::equations && beyond_unrelated > times_the_noise),
               beyond_unrelated);
  const bool nameless =
      !d.findings.empty() && std::all_of(d.findings.begin(), d.findings.end(),
                                         [](const Finding& f) { return f.stand_in != nullptr; });
  bool ambiguous = false;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      ambiguous = ambiguous || (a.explains_as_well() && is_another_cause(finding, a) &&
                                !is_elsewhere(finding.term, a.term));
  if (d.findings.empty())
    // What follows the recording is no noise, even where no curve and no name describes it.
    d.verdict =
        most_followed > plainly_followed || is_above_noise(data, d.best) || is_louder_in_motion(data, d.best)
            ? Verdict::unknown_physics
        : d.parameter_excursion > 3.0 ? Verdict::parameters_only
                                      : Verdict::no_mismatch;
  else if (d.is_unnamed || nameless)
    d.verdict = Verdict::unknown_physics;
  else if (ambiguous)
    d.verdict = Verdict::ambiguous;
  else
    d.verdict = d.has_rest || d.still_follows > 0.05 ||
                        std::any_of(rests.begin(), rests.end(), [](double rest) { return rest > 0.05; })
                    ? Verdict::partly_explained
                    : Verdict::explained;
  if (d.findings.empty() && d.verdict == Verdict::unknown_physics) d.suspect = most_suspect(data, d);
  keep_to_noise(data, d);
  std::sort(d.rejected.begin(), d.rejected.end(),
            [](const auto& a, const auto& b) { return a.gain > b.gain; });
  std::erase_if(d.rejected, [&](const Rejection& r) {
    return std::any_of(d.findings.begin(), d.findings.end(),
                       [&](const Finding& f) { return f.term.info->name == r.term; });
  });
}

}  // namespace invar::diagnosis
