// What each model is worth on stretches that its fit has not seen.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"

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
  const auto again = fit(data, coloured, whole.model, data.model, Effort::follow(6), &whole);
  return least_ratio(data, whole, again) < 0.97 ? weigh(data, simulate(data, whole.model), Colour::white)
                                                : coloured;
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
  auto weights = weigh(data, simulated, Colour::white);
  weights.temper *= independent_share_of(data, simulated);
  return weights;
}

/// The model fitted anew without the held-out rows. It begins where the whole recording put it: what is asked is whether
/// the model holds where it was not fitted, not whether the search finds it again.
Fit refitted(const Case& data, const Weighing& weights, std::size_t fold, const Fit& whole, Effort effort) {
  const auto train = fold_of(data, weights, fold).train;
  return fit(data, train, whole.model, data.model, effort, &whole);
}

enum class Course { none, free };

/// A free course knows nothing of a place that the rows of a fold never came to, and whoever asks it there gets whatever the
/// last rows beside it leave open; so does a state of what it began at, once the rows that would say so are kept back. Rows
/// that a fit leaves more open than their noise is, by its courses or by its beginnings, are not asked for.
void ask_what_is_known(const Case& data, const Fit& fold_fit, Course course, Weighing& test) {
  const bool is_curved = course == Course::free;
  std::vector<Eigen::Index> beginnings;
  for (std::size_t k = 0; k < fold_fit.free.size(); ++k)
    if (const auto& f = fold_fit.free[k];
        f.where == Freedom::Where::parameter && is_initial(fold_fit.model.parameters[f.index]))
      beginnings.push_back(static_cast<Eigen::Index>(k));
  if (!is_curved && beginnings.empty()) return;
  const Eigen::MatrixXd known = whitened(data, test, fold_fit.columns).dense();
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

struct Sums {
  Squares before, retuned, after;
};

/// A fold, and what the models simulate that were fitted without its rows.
struct Runs {
  Fold fold;
  std::vector<physics::Outputs> retuned, after, rival;
};

/// What the comparison with the held-out readings gives.
struct Comparison {
  std::vector<Sums> tested, trained;  // by output
  double gain = 0.0,
         over_given = 0.0;  // of what was not seen, in whitened residuals: over retuned and over given
};

bool has_found(const Case& data, const Diagnosis& d) {
  return d.best.model.terms.size() > data.model.terms.size();
}

std::array<Runs, folds> run_folds(const Case& data, const Diagnosis& d) {
  const bool any = has_found(data, d);
  const auto for_retuned = d.is_partial ? d.weighing : weights_of(data, d.weighing, d.retuned);
  const auto for_best = any && !d.is_partial ? weights_of(data, d.weighing, d.best) : for_retuned;
  const auto effort =
      d.is_partial ? Effort::polish(1) : Effort::follow(6);  // who stopped it does not want to wait
  // A claim must win by the weights of what it leaves itself; shown is the rival by those that suit it.
  const bool differs = any && !d.is_partial;
  const auto for_rival = differs ? weights_of_rival(data, d.retuned) : for_retuned;
  std::array<Runs, folds> runs;
  in_parallel(folds, [&](std::size_t k) {
    auto& [fold, retuned, after, rival] = runs[k];
    fold = fold_of(data, d.weighing, k);
    const auto fitted = refitted(data, for_retuned, k, d.retuned, effort);
    after = retuned = simulate(data, fitted.model);
    if (any) {
      const auto best = refitted(data, for_best, k, d.best, effort);
      ask_what_is_known(data, best, d.is_unnamed || d.has_rest ? Course::free : Course::none, fold.test);
      after = simulate(data, best.model);
    } else {
      ask_what_is_known(data, fitted, Course::none, fold.test);
    }
    rival =
        differs ? simulate(data, refitted(data, for_rival, k, d.retuned, Effort::polish(3)).model) : retuned;
  });
  return runs;
}

Comparison compare(const Case& data, const Case& recorded, const Diagnosis& d,
                   const std::array<Runs, folds>& runs) {
  Comparison all;
  all.tested.resize(data.outputs.size()), all.trained.resize(data.outputs.size());
  const auto nominal = simulate(data, data.model);
  for (const auto& [fold, retuned, after, rival] : runs) {
    for (const bool test : {true, false}) {
      const auto& on = test ? fold.test : fold.train;
      auto& sums = test ? all.tested : all.trained;
      const auto before = squares_left(recorded, nominal, on), without = squares_left(recorded, rival, on),
                 with = squares_left(recorded, after, on);
      for (std::size_t o = 0; o < sums.size(); ++o)
        sums[o].before += before[o], sums[o].retuned += without[o], sums[o].after += with[o];
    }
    if (!has_found(data, d)) continue;
    const auto beyond_best = [&, &on = fold.test, &best = after](const std::vector<physics::Outputs>& other) {
      return 0.5 * d.weighing.temper *
             (residual(data, on, other).squaredNorm() - residual(data, on, best).squaredNorm());
    };
    all.gain += beyond_best(retuned);
    all.over_given += beyond_best(nominal);
  }
  return all;
}

/// Fills the rows of the report, of the stretches held out and of those fitted.
void tabulate(const Case& data, const Case& recorded, const Comparison& all, Diagnosis& d) {
  const auto simulated = simulate(recorded, d.best.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const double noise = instrument_noise(recorded, simulated, o);
    const auto& signal = *data.model.signal(data.outputs[o]);
    const auto row = [&](const Sums& sums) {
      return FitRow{signal.name,       signal.unit == "degC" ? "K" : signal.unit,
                    sums.before.rms(), sums.retuned.rms(),
                    sums.after.rms(),  0.0};
    };
    d.heldout.push_back(row(all.tested[o]));
    d.train.push_back(row(all.trained[o]));
    d.heldout.back().noise_floor = d.train.back().noise_floor =
        std::isfinite(data.given_noise[o]) ? data.given_noise[o] : std::min(d.heldout.back().after, noise);
  }
}

/// Is a model worse than another on the outputs that have held-out readings enough?
bool errs_more(const Comparison& all, const Diagnosis& d, OfModel one, OfModel than) {
  std::vector<FitRow> compared;
  for (std::size_t o = 0; o < all.tested.size(); ++o)
    if (all.tested[o].before.count >= thresholds::held_out_readings) compared.push_back(d.heldout[o]);
  return is_worse(compared, one, than);
}

/// In the rows of the report one model takes the place of another.
void copy_rows(Diagnosis& d, OfModel to, OfModel from) {
  for (auto* rows : {&d.heldout, &d.train})
    for (auto& row : *rows) row.*to = row.*from;
}

/// Numbers that lead away from what was not seen are not taken over.
void keep_given_numbers(const Case& data, Diagnosis& d) {
  const bool any = has_found(data, d);
  d.retuned = fit(data, d.weighing, data.model, data.model, Effort::evaluate());
  copy_rows(d, &FitRow::retuned, &FitRow::before);
  if (any) return;
  d.best = d.retuned;
  copy_rows(d, &FitRow::after, &FitRow::before);
}

void take_all_back(Diagnosis& d) {
  for (const auto& finding : d.findings)
    d.reject(std::string{finding.term.info->name}, "no gain on held-out data",
             d.best.evidence - d.retuned.evidence);
  d.findings.clear();
  d.best = d.retuned;
  d.is_unnamed = d.has_rest = false;
  copy_rows(d, &FitRow::after, &FitRow::retuned);
}

}  // namespace

void hold_out(const Case& data, const Case& recorded, Diagnosis& d, Claims claims) {
  auto all = compare(data, recorded, d, run_folds(data, d));
  tabulate(data, recorded, all, d);
  if (claims == Claims::kept) return;
  if (errs_more(all, d, &FitRow::retuned, &FitRow::before)) {
    keep_given_numbers(data, d);
    all.gain = all.over_given;
  }
  if (!has_found(data, d)) return;
  // A claim must help on what it has not seen. Where a loop feeds noise back a run without noise may lie farther off.
  const bool is_loop = data.model.controller || !data.model.equations.controlled_input.empty();
  const bool is_nearer = std::any_of(d.heldout.begin(), d.heldout.end(),
                                     [](const FitRow& row) { return row.after < row.retuned; });
  const bool misleads = errs_more(all, d, &FitRow::after, &FitRow::retuned);
  if (misleads && d.findings.size() > 1) {  // the last finding is the least
    take_last_back(data, d, "with it the model is worse on held-out data");
    d.heldout.clear();
    d.train.clear();
    hold_out(data, recorded, d, claims);
    return;
  }
  if (all.gain < thresholds::held_out_gain || misleads || !(is_loop || is_nearer)) take_all_back(d);
}

}  // namespace invar::diagnosis
