#include "core/metrology/geometric/error_motion_identification.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/base/contract.hpp"
#include "core/numerics/rbf_ridge.hpp"
#include "core/numerics/robust.hpp"
#include "core/numerics/sure_gain.hpp"

namespace invar::metrology {

namespace {

// Readings within a cell are averaged. Cells grow where a log holds more than so many: a fit takes their number's cube.
constexpr double finest_places = 1e4;  // of the travel
constexpr double enough_places = 64.0;
constexpr double finest_levels = 20.0;  // of a state's range
constexpr std::size_t most_means = 700;
constexpr double far_off = 5.0;        // robust deviations
constexpr double standard_errors = 2;  // that a further input must gain
constexpr int most_centres = 33;       // over the position
constexpr int most_rounds = 4;
constexpr int most_centres_of_state = 5;
constexpr double width_of_state = 2.0;  // of its range

using Key = std::vector<long>;

using Groups = std::map<Key, std::vector<Eigen::Index>>;

/// The readings that are not left out, by place and state.
Groups grouped(const ErrorMotionReadings& readings, const std::vector<bool>& kept, double places,
               double levels) {
  const Eigen::Index states = readings.state.rows();
  std::vector<Range> ranges;
  for (Eigen::Index s = 0; s < states; ++s)
    ranges.push_back({readings.state.row(s).minCoeff(), readings.state.row(s).maxCoeff()});
  const double first = readings.position.minCoeff(), travel = readings.position.maxCoeff() - first;
  Groups groups;
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    if (!kept[static_cast<std::size_t>(i)]) continue;
    Key key{std::lround((readings.position[i] - first) / travel * places)};
    for (Eigen::Index s = 0; s < states; ++s) {
      const Range& range = ranges[static_cast<std::size_t>(s)];
      key.push_back(range.width() > 0.0
                        ? std::lround((readings.state(s, i) - range.lower) / range.width() * levels)
                        : 0);
    }
    groups[key].push_back(i);
  }
  return groups;
}

/// Means of the readings that are not left out, by place and state.
ErrorMotionReadings averaged(const ErrorMotionReadings& readings, const std::vector<bool>& kept) {
  const Eigen::Index states = readings.state.rows();
  double places = finest_places, levels = finest_levels;
  Groups groups = grouped(readings, kept, places, levels);
  while (groups.size() > most_means) {
    (places > enough_places ? places : levels) /= 2.0;
    groups = grouped(readings, kept, places, levels);
  }
  ErrorMotionReadings means;
  const auto count = static_cast<Eigen::Index>(groups.size());
  means.position.resize(count);
  means.state.resize(states, count);
  means.value.resize(count);
  Eigen::Index next = 0;
  for (const auto& [key, rows] : groups) {
    means.position[next] = readings.position(rows).mean();
    means.value[next] = readings.value(rows).mean();
    for (Eigen::Index s = 0; s < states; ++s) means.state(s, next) = readings.state.row(s)(rows).mean();
    ++next;
  }
  return means;
}

/// Distinct values, counted in cells of a twentieth of the range.
int distinct(const Eigen::VectorXd& values, int most) {
  const Range range{values.minCoeff(), values.maxCoeff()};
  if (range.width() <= 0.0) return 1;
  std::vector<long> cells;
  for (const double value : values)
    cells.push_back(std::lround((value - range.lower) / range.width() * 20.0 * most));
  std::sort(cells.begin(), cells.end());
  const auto count = std::unique(cells.begin(), cells.end()) - cells.begin();
  return static_cast<int>(std::clamp<std::ptrdiff_t>(count, 1, most));
}

numerics::RidgeFit fit_over(const ErrorMotionReadings& means, const std::vector<std::size_t>& states) {
  Eigen::MatrixXd inputs(1 + static_cast<Eigen::Index>(states.size()), means.position.size());
  inputs.row(0) = means.position.transpose();
  numerics::RidgeOptions options;
  options.counts = {distinct(means.position, most_centres)};
  options.spacings = {2.0};
  for (std::size_t i = 0; i < states.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i) + 1;
    inputs.row(row) = means.state.row(static_cast<Eigen::Index>(states[i]));
    options.counts.push_back(distinct(inputs.row(row).transpose(), most_centres_of_state));
    // Few levels of a state are measured: Gaussians as wide as its range bend little between them.
    options.spacings.push_back(std::max(1.0, width_of_state * (options.counts.back() - 1)));
  }
  return numerics::fit_ridge(inputs, means.value, options);
}

/// Means end up to half a cell before the readings do; so far the network goes on as it is.
void reach_ends(const ErrorMotionReadings& readings, const std::vector<bool>& kept,
                ErrorMotionNetwork& motion) {
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    if (!kept[static_cast<std::size_t>(i)]) continue;
    const auto reach = [](Range& range, double value) {
      range = {std::min(range.lower, value), std::max(range.upper, value)};
    };
    reach(motion.network.range[0], readings.position[i]);
    for (std::size_t k = 0; k < motion.states.size(); ++k)
      reach(motion.network.range[k + 1], readings.state(static_cast<Eigen::Index>(motion.states[k]), i));
  }
}

std::vector<double> squared(const Eigen::VectorXd& values) {
  std::vector<double> result;
  for (const double value : values) result.push_back(value * value);
  return result;
}

}  // namespace

ErrorMotionFit identify_error_motion(const ErrorMotionReadings& readings) {
  const Eigen::Index count = readings.position.size();
  INVAR_EXPECTS(count >= least_error_motion_readings && readings.value.size() == count &&
                    readings.state.cols() == count,
                count, readings.value.size(), readings.state.cols());
  ErrorMotionFit result;
  result.kept.assign(static_cast<std::size_t>(count), true);
  std::vector<std::size_t> states;
  numerics::RidgeFit fit;
  // Again without what the fit shows to be far off, until that is settled.
  for (int round = 0; round < most_rounds; ++round) {
    const ErrorMotionReadings means = averaged(readings, result.kept);
    states.clear();
    fit = fit_over(means, states);
    result.over_position = fit.leave_one_out_rms();
    while (states.size() < most_states_of_an_error_motion) {
      std::optional<numerics::RidgeFit> best;
      std::size_t which = 0;
      for (Eigen::Index s = 0; s < means.state.rows(); ++s) {
        const auto state = static_cast<std::size_t>(s);
        const bool used = std::find(states.begin(), states.end(), state) != states.end();
        if (used || distinct(means.state.row(s).transpose(), most_centres_of_state) < 2) continue;
        std::vector<std::size_t> more = states;
        more.push_back(state);
        if (means.position.size() < static_cast<Eigen::Index>(more.size()) + 3) continue;
        numerics::RidgeFit tried = fit_over(means, more);
        if (best && tried.leave_one_out_rms() >= best->leave_one_out_rms()) continue;
        best = std::move(tried);
        which = state;
      }
      if (!best ||
          !numerics::surely_less(squared(best->leave_one_out), squared(fit.leave_one_out), standard_errors))
        break;
      states.push_back(which);
      fit = std::move(*best);
    }
    result.motion = {fit.network, states, 0.0, fit.rms_slope};
    reach_ends(readings, result.kept, result.motion);
    double variance = 0.0;
    for (Eigen::Index i = 0; i < means.position.size(); ++i) {
      Eigen::VectorXd input(1 + static_cast<Eigen::Index>(states.size()));
      input[0] = means.position[i];
      for (std::size_t k = 0; k < states.size(); ++k)
        input[1 + static_cast<Eigen::Index>(k)] = means.state(static_cast<Eigen::Index>(states[k]), i);
      variance += std::pow(fit.sigma(input), 2) / static_cast<double>(means.position.size());
    }
    result.motion.sigma = std::sqrt(variance);
    result.left_out = fit.leave_one_out_rms();
    result.rest.clear();
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::VectorXd state = readings.state.col(i);
      result.rest.push_back(
          readings.value[i] -
          result.motion.value(readings.position[i], {state.data(), static_cast<std::size_t>(state.size())}));
    }
    result.noise = numerics::robust_deviation(result.rest, 0.0);
    std::vector<bool> kept;
    for (const double each : result.rest)
      kept.push_back(result.noise <= 0.0 || std::abs(each) <= far_off * result.noise);
    if (kept == result.kept) break;
    if (round + 1 < most_rounds) result.kept = kept;
  }
  result.rejected = static_cast<std::size_t>(std::count(result.kept.begin(), result.kept.end(), false));
  return result;
}

ErrorMotionReadings without_reversal(ErrorMotionReadings readings, const ReversalCurve& reversal) {
  for (Eigen::Index i = 0; i < readings.position.size(); ++i)
    readings.value[i] -=
        0.5 * readings.direction[static_cast<std::size_t>(i)] * reversal.value(readings.position[i]);
  return readings;
}

}  // namespace invar::metrology
