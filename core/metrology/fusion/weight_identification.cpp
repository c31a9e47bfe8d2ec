#include "core/metrology/fusion/weight_identification.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/numerics/decompositions.hpp"
#include "core/numerics/rbf_kernel.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

/// All sensors' positions, each moved on by its delay.
Eigen::MatrixXd aligned(const FusionRun& run, const std::vector<double>& delays) {
  Eigen::MatrixXd all = integrated(run);
  if (delays.empty()) return all;
  const Motion motion = motion_of(run);
  for (Eigen::Index k = 0; k < all.cols(); ++k)
    all.col(k) += delays[static_cast<std::size_t>(k)] * motion.velocity;
  return all;
}

/// Least squares monotone sequence: neighbours that go the wrong way share their mean.
std::vector<double> rising(const std::vector<double>& values, const std::vector<double>& weights) {
  struct Pool {
    double value, weight;
    std::size_t size;
  };
  std::vector<Pool> pools;
  for (std::size_t i = 0; i < values.size(); ++i) {
    pools.push_back({values[i], weights[i], 1});
    while (pools.size() > 1 && pools[pools.size() - 2].value > pools.back().value) {
      const Pool last = pools.back();
      pools.pop_back();
      Pool& before = pools.back();
      before.value =
          (before.value * before.weight + last.value * last.weight) / (before.weight + last.weight);
      before.weight += last.weight;
      before.size += last.size;
    }
  }
  std::vector<double> result;
  for (const Pool& pool : pools) result.insert(result.end(), pool.size, pool.value);
  return result;
}

double misfit(const std::vector<double>& a, const std::vector<double>& b,
              const std::vector<double>& weights) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += weights[i] * std::pow(a[i] - b[i], 2);
  return sum;
}

void fit_polynomial(WeightModel& model, const std::vector<FusionRun>& runs, int degree) {
  const Eigen::Index sensors = model.positions + model.velocities;
  FusionPolynomial& p = model.polynomial;
  double low = 1e300;
  double high = -1e300;
  p.difference_reach = 1e-9;
  struct Cell {
    Eigen::MatrixXd all;
    std::vector<Eigen::Index> rows;
    Eigen::VectorXd mean;
  };
  std::vector<Cell> cells;
  for (const FusionRun& run : runs) {
    Cell cell{aligned(run, model.delays), {}, {}};
    cell.rows = complete_rows(cell.all);
    cell.mean = cell.all * weights_at(model, selectors_of(run));
    for (const Eigen::Index i : cell.rows) {
      low = std::min(low, cell.mean(i));
      high = std::max(high, cell.mean(i));
      for (Eigen::Index k = 1; k < sensors; ++k)
        p.difference_reach = std::max(p.difference_reach, std::abs(cell.all(i, k) - cell.all(i, 0)));
    }
    cells.push_back(std::move(cell));
  }
  if (!(high > low)) return;
  p.degree = degree;
  p.centre = 0.5 * (low + high);
  p.reach = 0.5 * (high - low);
  const auto powers = monomials(static_cast<int>(sensors), degree);
  const auto terms = static_cast<Eigen::Index>(powers.size());
  Eigen::MatrixXd gram = Eigen::MatrixXd::Identity(terms, terms) * 1e-6;
  Eigen::VectorXd moment = Eigen::VectorXd::Zero(terms);
  Eigen::VectorXd row(terms);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Cell& cell = cells[r];
    for (const Eigen::Index i : cell.rows) {
      std::array<double, most_sensors> z{};
      z[0] = (cell.mean(i) - p.centre) / p.reach;
      for (Eigen::Index k = 1; k < sensors; ++k)
        z[static_cast<std::size_t>(k)] = (cell.all(i, k) - cell.all(i, 0)) / p.difference_reach;
      for (Eigen::Index t = 0; t < terms; ++t) row(t) = monomial(powers[static_cast<std::size_t>(t)], z);
      gram.selfadjointView<Eigen::Lower>().rankUpdate(row);
      moment += row * (runs[r].reference(i) - cell.mean(i) - model.intercept);
    }
  }
  gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
  p.coefficients = numerics::least_squares(gram, moment);
}

}  // namespace

Eigen::VectorXd selectors_of(const FusionRun& run) {
  const bool further = run.selector.size() > 0;
  Eigen::VectorXd selectors(further ? 3 : 2);
  selectors(0) = typical_speed(motion_of(run));
  selectors(1) = run_noise(run);
  if (further) selectors(2) = run.selector.mean();
  return selectors;
}

NoiseBySpeed identify_noise_by_speed(const std::vector<FusionRun>& runs) {
  constexpr Eigen::Index window = 64;
  std::vector<std::pair<double, double>> found;  // speed, log deviation
  for (const FusionRun& run : runs) {
    if (run.velocities.cols() < 1) return {};
    const Motion motion = motion_of(run);
    for (Eigen::Index from = 2; from + window <= run.time.size(); from += window) {
      double squares = 0.0;
      for (Eigen::Index i = from; i < from + window; ++i)
        squares +=
            std::pow(run.velocities(i, 0) - 2.0 * run.velocities(i - 1, 0) + run.velocities(i - 2, 0), 2);
      if (!(squares > 0.0)) continue;  // missing readings, or none that differ
      found.emplace_back(motion.velocity.segment(from, window).cwiseAbs().mean(),
                         0.5 * std::log(squares / (6.0 * window)));
    }
  }
  if (found.size() < 4) return {};
  std::sort(found.begin(), found.end());
  const std::size_t bins = std::min<std::size_t>(12, found.size() / 2);
  NoiseBySpeed noise;
  std::vector<double> weights;
  for (std::size_t b = 0; b < bins; ++b) {
    const std::size_t from = b * found.size() / bins;
    const std::size_t to = (b + 1) * found.size() / bins;
    std::vector<double> speeds, logs;
    for (std::size_t i = from; i < to; ++i) {
      speeds.push_back(found[i].first);
      logs.push_back(found[i].second);
    }
    const double speed = numerics::median(speeds);
    if (!noise.speed.empty() && speed <= noise.speed.back()) continue;
    noise.speed.push_back(speed);
    noise.log_deviation.push_back(numerics::median(logs));
    weights.push_back(static_cast<double>(to - from));
  }
  const std::vector<double> up = rising(noise.log_deviation, weights);
  std::vector<double> turned = noise.log_deviation;
  for (double& value : turned) value = -value;
  std::vector<double> down = rising(turned, weights);
  for (double& value : down) value = -value;
  noise.log_deviation =
      misfit(noise.log_deviation, up, weights) <= misfit(noise.log_deviation, down, weights) ? up : down;
  return noise;
}

WeightModel identify_weights(const std::vector<FusionRun>& runs, const WeightOptions& options) {
  WeightModel model;
  model.positions = static_cast<int>(runs.front().positions.cols());
  model.velocities = static_cast<int>(runs.front().velocities.cols());
  const Eigen::Index sensors = model.positions + model.velocities;
  model.delays = options.delays;
  model.delays.resize(static_cast<std::size_t>(sensors), 0.0);
  if (options.noise_by_speed) model.noise = identify_noise_by_speed(runs);
  const auto count = static_cast<Eigen::Index>(runs.size());
  Eigen::MatrixXd selectors(selectors_of(runs.front()).size(), count);
  Eigen::MatrixXd weights(sensors, count);
  std::vector<double> intercepts;
  for (Eigen::Index r = 0; r < count; ++r) {
    const FusionRun& run = runs[static_cast<std::size_t>(r)];
    const Eigen::MatrixXd all = aligned(run, model.delays);
    const auto rows = complete_rows(all);
    selectors.col(r) = selectors_of(run);
    weights.col(r).setConstant(1.0 / static_cast<double>(sensors));
    if (static_cast<Eigen::Index>(rows.size()) <= sensors + 1) continue;
    const WeightFit fit = fit_weights(all(rows, Eigen::all), run.reference(rows));
    weights.col(r) = fit.weights.cwiseMax(0.0).cwiseMin(1.0);
    intercepts.push_back(fit.intercept);
  }
  model.intercept = intercepts.empty() ? 0.0 : numerics::median(intercepts);
  for (Eigen::Index i = 1; i < sensors; ++i) {
    if (count >= 5) {
      // Lengths that matter: 0.2 m/s and 570 % of noise (docs/explanation/fusion.md#weights-over-speed-and-noise); of a
      // further attribute half its range.
      numerics::KernelOptions kernel;
      kernel.input_scale = {0.2, 5.7};
      if (selectors.rows() > 2)
        kernel.input_scale.push_back(
            std::max(0.5 * (selectors.row(2).maxCoeff() - selectors.row(2).minCoeff()), 1e-9));
      model.weights.push_back(numerics::fit_kernel(selectors, weights.row(i).transpose(), kernel).network);
    } else {  // too few runs for a surface: their mean
      numerics::RbfNetwork constant;
      for (Eigen::Index d = 0; d < selectors.rows(); ++d)
        constant.range.push_back({selectors.row(d).minCoeff(), selectors.row(d).maxCoeff()});
      constant.input_offset = constant.slope = Eigen::VectorXd::Zero(selectors.rows());
      constant.input_scale = Eigen::VectorXd::Ones(selectors.rows());
      constant.centres = constant.widths = Eigen::MatrixXd::Ones(selectors.rows(), 0);
      constant.constant = weights.row(i).mean();
      model.weights.push_back(std::move(constant));
    }
  }
  if (options.degree > 1) fit_polynomial(model, runs, options.degree);
  return model;
}

}  // namespace invar::metrology
