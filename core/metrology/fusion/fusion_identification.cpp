#include "core/metrology/fusion/fusion_identification.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/metrology/fusion/fusion_observer.hpp"
#include "core/numerics/sure_gain.hpp"

namespace invar::metrology {

namespace {

constexpr std::size_t most_folds = 3;
constexpr int highest_degree = 4;

std::vector<double> delays_of(const FusionModel& sensors) {
  std::vector<double> delays;
  for (const auto& sensor : sensors.positions) delays.push_back(sensor.delay);
  for (const auto& sensor : sensors.velocities) delays.push_back(sensor.lag);
  return delays;
}

/// Squared errors of each run, by a method that did not see it.
using Squares = std::vector<double>;

double rms_of(const Squares& squares) {
  double sum = 0.0;
  for (const double value : squares) sum += value;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(squares.size(), 1)));
}

void describe_run(HeldOut& held, const FusionRun& run) {
  held.speed = typical_speed(motion_of(run));
  held.noise_level = run_noise(run);
  const Eigen::MatrixXd all = integrated(run);
  const auto rows = complete_rows(all);
  held.best_single = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < all.cols(); ++k)
    held.best_single =
        std::min(held.best_single, std::sqrt((all(rows, k) - run.reference(rows)).squaredNorm() /
                                             static_cast<double>(std::max<std::size_t>(rows.size(), 1))));
  if (static_cast<Eigen::Index>(rows.size()) > all.cols() + 1) {
    const WeightFit one = fit_weights(all(rows, Eigen::all), run.reference(rows));
    held.fitted.assign(one.weights.begin(), one.weights.end());
  }
}

}  // namespace

FusionFit identify_fusion(const std::vector<FusionRun>& given, const std::vector<std::string>& position_names,
                          const std::vector<std::string>& velocity_names, const FusionOptions& options) {
  std::vector<FusionRun> runs = given;
  if (options.noise_estimated)
    for (FusionRun& run : runs) run.noise_level.resize(0);
  const bool noise_known = runs.front().noise_level.size() > 0;
  FusionFit fit;
  fit.sensors = identify_sensors(runs, position_names, velocity_names, &fit.unidentified);

  // The ways to weigh: plain, with the noise from the speed, and of higher order.
  std::vector<WeightOptions> ways(1);
  const std::size_t by_speed = noise_known || velocity_names.empty() ? 0 : ways.size();
  if (by_speed > 0) ways.push_back({.delays = {}, .noise_by_speed = true});
  const std::size_t orders = ways.size();
  for (int degree = 2; options.polynomial && degree <= highest_degree; ++degree)
    ways.push_back({.degree = degree, .delays = {}});

  fit.nothing_held_out = runs.size() < 2;
  const std::size_t folds = std::min(most_folds, runs.size());
  fit.held_out.resize(runs.size());
  Squares observer_squares(runs.size());
  std::vector<Squares> squares(ways.size(), Squares(runs.size()));
  for (std::size_t fold = 0; fold < folds; ++fold) {
    std::vector<FusionRun> train;
    for (std::size_t r = 0; r < runs.size(); ++r)
      if (fit.nothing_held_out || r % folds != fold) train.push_back(runs[r]);
    const FusionModel sensors = identify_sensors(train, position_names, velocity_names, nullptr);
    FusionObserver observer{sensors};
    for (std::size_t r = fold; r < runs.size(); r += folds) {
      fit.held_out[r].observer = rms_error(fuse(observer, runs[r]), runs[r]);
      observer_squares[r] = std::pow(fit.held_out[r].observer, 2);
    }
    for (std::size_t w = 0; w < ways.size(); ++w) {
      WeightOptions way = ways[w];
      way.delays = delays_of(sensors);
      WeightedFusion weighted{identify_weights(train, way)};
      for (std::size_t r = fold; r < runs.size(); r += folds) {
        squares[w][r] = std::pow(rms_error(fuse(weighted, runs[r]), runs[r]), 2);
        if (w == 0) fit.held_out[r].weights = std::sqrt(squares[w][r]);
      }
    }
  }
  for (std::size_t r = 0; r < runs.size(); ++r) describe_run(fit.held_out[r], runs[r]);

  fit.observer_rms = rms_of(observer_squares);
  fit.weights_rms = rms_of(squares[0]);
  if (by_speed > 0) fit.noise_by_speed_rms = rms_of(squares[by_speed]);
  // What was fitted to a run is better on it the more numbers it has: with nothing held out nothing is chosen by that.
  std::size_t best =
      !fit.nothing_held_out && by_speed > 0 && numerics::surely_less(squares[by_speed], squares[0]) ? by_speed
                                                                                                    : 0;
  WeightOptions chosen = ways[best];
  for (std::size_t w = orders; w < ways.size(); ++w) {
    const double rms = rms_of(squares[w]);
    if (fit.polynomial_rms == 0.0 || rms < fit.polynomial_rms) fit.polynomial_rms = rms;
    if (fit.nothing_held_out || !numerics::surely_less(squares[w], squares[0]) ||
        rms >= rms_of(squares[best]))
      continue;
    best = w;
    chosen = ways[w];
  }
  fit.degree = chosen.degree;
  chosen.delays = delays_of(fit.sensors);
  fit.weights = identify_weights(runs, chosen);
  fit.method = fit.nothing_held_out || fit.observer_rms <= rms_of(squares[best]) ? FusionMethod::observer
                                                                                 : FusionMethod::weights;
  if (fit.nothing_held_out)
    fit.notes.emplace_back(
        "one run only: nothing was held out, and what other runs will show is not known; the observer is "
        "taken, which "
        "knows the sensors; record a second run");
  return fit;
}

}  // namespace invar::metrology
