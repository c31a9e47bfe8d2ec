#include "core/metrology/geometric/axis_reversal.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/index.hpp"
#include "core/numerics/gaussian_prior.hpp"

namespace invar::metrology {

namespace {

constexpr int pieces = 12;                 // of a curve's spline
constexpr double wide = 1e-3;              // m, sd of the constant beforehand
constexpr double nugget = 1e-6;            // of the waves' variance: keeps long waves well conditioned
constexpr double weakest = 3e-9;           // m, sd of waves that nobody would see
constexpr double stronger = 1.7782794100;  // by a quarter of a decade
constexpr int strengths = 19;              // up to 95 um
constexpr std::array<double, 4> lengths{0.12, 0.25, 0.5, 1.0};  // of the travel, over which waves change

/// What is not yet known about one axis: strength and length of its waves.
struct Waves {
  int axis = 0;
  double strength = weakest;
  double length = 0.5;  // of the travel
};

Eigen::MatrixXd prior_of(const numerics::CubicBSpline& spline, const Waves& waves) {
  const int n = spline.size();
  const double length = waves.length * spline.interval().width();
  Eigen::MatrixXd covariance(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) {
      const double wave = numerics::matern52(std::abs(spline.place(i) - spline.place(j)), length);
      covariance(i, j) = covariance(j, i) =
          wide * wide + waves.strength * waves.strength * (wave + (i == j ? nugget : 0.0));
    }
  return covariance;
}

/// -2 log likelihood = constant - 2 right'theta + theta' normal theta, theta the coefficients of all curves.
struct Equations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
};

struct Solution {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double log_evidence = 0.0;
};

/// Whitened by the prior's Cholesky factor L, theta = L z: well conditioned however flat the prior is.
Solution solve(const Equations& equations, const numerics::CubicBSpline& any, const std::vector<Waves>& axes,
               const std::vector<numerics::CubicBSpline>& splines) {
  const Eigen::Index n = any.size();
  const auto all = n * static_cast<Eigen::Index>(axes.size());
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(all, all);
  for (std::size_t a = 0; a < axes.size(); ++a)
    factor.block(static_cast<Eigen::Index>(a) * n, static_cast<Eigen::Index>(a) * n, n, n) =
        prior_of(splines[a], axes[a]).llt().matrixL();
  const Eigen::MatrixXd inner =
      Eigen::MatrixXd::Identity(all, all) + factor.transpose() * equations.normal * factor;
  const Eigen::LLT<Eigen::MatrixXd> solver{inner};
  const Eigen::VectorXd right = factor.transpose() * equations.right;
  const Eigen::VectorXd z = solver.solve(right);
  Solution solution;
  solution.mean = factor * z;
  solution.covariance = factor * solver.solve(factor.transpose());
  solution.log_evidence = 0.5 * right.dot(z) - solver.matrixLLT().diagonal().array().log().sum();
  return solution;
}

Equations equations_of(const std::vector<CondensedLine>& lines, const std::vector<Waves>& axes,
                       const std::vector<numerics::CubicBSpline>& splines) {
  const Eigen::Index n = splines.front().size();
  const auto all = n * static_cast<Eigen::Index>(axes.size());
  Equations equations{Eigen::MatrixXd::Zero(all, all), Eigen::VectorXd::Zero(all)};
  for (const CondensedLine& line : lines) {
    const LineReversal& reversal = line.reversal;
    if (reversal.places.size() == 0) continue;
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(reversal.places.size(), all);
    for (Eigen::Index i = 0; i < reversal.places.size(); ++i) {
      const Eigen::Vector3d at = line.beam.start + reversal.places[i] * line.beam.direction;
      for (std::size_t a = 0; a < axes.size(); ++a) {
        const int k = axes[a].axis;
        const auto w = splines[a].at(at[k]);
        for (int c = 0; c < 4; ++c)
          rows(i, static_cast<Eigen::Index>(a) * n + w.first + c) +=
              std::abs(line.beam.direction[k]) * w.value[index(c)];
      }
    }
    equations.normal += rows.transpose() * reversal.information * rows;
    equations.right += rows.transpose() * reversal.weighted;
  }
  return equations;
}

/// The best strength and length of each axis in turn, the others held.
void choose_waves(const Equations& equations, std::vector<Waves>& axes,
                  const std::vector<numerics::CubicBSpline>& splines) {
  for (int sweep = 0; sweep < 2; ++sweep)
    for (Waves& own : axes) {
      Waves best = own;
      double most = -std::numeric_limits<double>::infinity();
      for (const double length : lengths)
        for (int s = 0; s < strengths; ++s) {
          own.length = length;
          own.strength = weakest * std::pow(stronger, s);
          const double value = solve(equations, splines.front(), axes, splines).log_evidence;
          if (value <= most) continue;
          most = value;
          best = own;
        }
      own = best;
    }
}

/// Mean and covariance of one axis' coefficients, averaged over its strength and length.
Solution averaged(const Equations& equations, std::vector<Waves> axes, std::size_t which,
                  const std::vector<numerics::CubicBSpline>& splines) {
  const Eigen::Index n = splines.front().size();
  const Eigen::Index first = static_cast<Eigen::Index>(which) * n;
  std::vector<Solution> all;
  double most = -std::numeric_limits<double>::infinity();
  for (const double length : lengths)
    for (int s = 0; s < strengths; ++s) {
      axes[which].length = length;
      axes[which].strength = weakest * std::pow(stronger, s);
      const Solution whole = solve(equations, splines.front(), axes, splines);
      all.push_back(
          {whole.mean.segment(first, n), whole.covariance.block(first, first, n, n), whole.log_evidence});
      most = std::max(most, whole.log_evidence);
    }
  Solution sum{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n), 0.0};
  double weights = 0.0;
  for (const Solution& one : all) {
    const double weight = std::exp(one.log_evidence - most);
    weights += weight;
    sum.mean += weight * one.mean;
    sum.covariance += weight * (one.covariance + one.mean * one.mean.transpose());
  }
  sum.mean /= weights;
  sum.covariance = sum.covariance / weights - sum.mean * sum.mean.transpose();
  return sum;
}

ReversalCurve curve_of(const Solution& solution, const numerics::CubicBSpline& spline) {
  ReversalCurve curve{spline, solution.mean, Eigen::VectorXd::Zero(spline.intervals() + 1)};
  for (int i = 0; i <= spline.intervals(); ++i) {
    const auto w = spline.at(spline.interval().lower + i * spline.spacing());
    double variance = 0.0;
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b)
        variance += w.value[index(a)] * w.value[index(b)] * solution.covariance(w.first + a, w.first + b);
    curve.sigma[i] = std::sqrt(std::max(variance, 0.0));
  }
  return curve;
}

}  // namespace

double ReversalCurve::value(double position) const noexcept {
  return empty() ? 0.0 : spline.value(coefficients, position);
}

double ReversalCurve::sigma_at(double position) const noexcept {
  if (empty()) return std::numeric_limits<double>::infinity();
  const double u = (spline.interval().clamp(position) - spline.interval().lower) / spline.spacing();
  const int low = std::min(static_cast<int>(u), spline.intervals() - 1);
  return sigma[low] + (u - low) * (sigma[low + 1] - sigma[low]);
}

double ReversalCurve::mean() const noexcept {
  constexpr int places = 100;
  double sum = 0.0;
  for (int i = 0; i < places; ++i)
    sum += value(spline.interval().lower + (i + 0.5) / places * spline.interval().width());
  return sum / places;
}

Eigen::Vector3d reversal_at(const std::array<ReversalCurve, 3>& reversal, const Eigen::Vector3d& position,
                            const Eigen::Vector3d& moving) noexcept {
  Eigen::Vector3d result;
  for (int k = 0; k < 3; ++k) result[k] = 0.5 * moving[k] * reversal[index(k)].value(position[k]);
  return result;
}

Eigen::Vector3d reversal_sigma_at(const std::array<ReversalCurve, 3>& reversal,
                                  const Eigen::Vector3d& position, const Eigen::Vector3d& moving) noexcept {
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    if (moving[k] != 0.0) result[k] = 0.5 * std::abs(moving[k]) * reversal[index(k)].sigma_at(position[k]);
  return result;
}

ReversalCurve reversal_of_readings(const Eigen::VectorXd& position, const Eigen::VectorXd& value,
                                   const std::vector<int>& direction, Range travel) {
  constexpr double cell = 1e-7;  // m, readings nearer than this are of one place
  struct Place {
    double at = 0.0;
    std::array<double, 2> sum{}, square{}, count{};
  };
  std::map<long, Place> places;
  for (Eigen::Index i = 0; i < position.size(); ++i) {
    Place& one = places[std::lround(position[i] / cell)];
    const std::size_t way = direction[static_cast<std::size_t>(i)] > 0 ? 0 : 1;
    one.at = position[i];
    one.sum[way] += value[i];
    one.square[way] += value[i] * value[i];
    one.count[way] += 1.0;
  }
  double scatter = 0.0;
  double degrees = 0.0;
  std::vector<Place> both;
  for (const auto& [key, one] : places) {
    for (std::size_t way = 0; way < 2; ++way) {
      if (one.count[way] < 2.0) continue;
      scatter += one.square[way] - one.sum[way] * one.sum[way] / one.count[way];
      degrees += one.count[way] - 1.0;
    }
    if (one.count[0] > 0.0 && one.count[1] > 0.0) both.push_back(one);
  }
  if (both.empty()) return {};
  // Without repeats the differences of neighbouring places say how far they scatter.
  const auto lost = [](const Place& one) { return one.sum[0] / one.count[0] - one.sum[1] / one.count[1]; };
  if (degrees < 1.0)
    for (std::size_t i = 1; i < both.size(); ++i) {
      scatter += 0.25 * std::pow(lost(both[i]) - lost(both[i - 1]), 2);
      degrees += 1.0;
    }
  const double variance = std::max(scatter / std::max(degrees, 1.0), 1e-20);
  CondensedLine line;
  line.beam.start = {travel.lower, 0.0, 0.0};
  line.beam.direction = {1.0, 0.0, 0.0};
  line.beam.length = travel.width();
  const auto count = static_cast<Eigen::Index>(both.size());
  line.reversal.places.resize(count);
  line.reversal.information = Eigen::MatrixXd::Zero(count, count);
  line.reversal.weighted.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Place& one = both[static_cast<std::size_t>(i)];
    line.reversal.places[i] = one.at - travel.lower;
    line.reversal.information(i, i) = 1.0 / (variance * (1.0 / one.count[0] + 1.0 / one.count[1]));
    line.reversal.weighted[i] = line.reversal.information(i, i) * lost(one);
  }
  return axis_reversals({line}, {{0, 1, 2}, 1}, {travel, travel, travel})[0];
}

ReversalCurve constant_reversal(Range travel, double value, double sigma) {
  const numerics::CubicBSpline spline{travel, 1};
  return {spline, Eigen::VectorXd::Constant(spline.size(), value), Eigen::VectorXd::Constant(2, sigma)};
}

std::array<ReversalCurve, 3> axis_reversals(const std::vector<CondensedLine>& lines, const Chain& chain,
                                            const std::array<Range, 3>& travel) {
  std::array<ReversalCurve, 3> curves;
  std::vector<Waves> axes;
  std::vector<numerics::CubicBSpline> splines;
  for (int k = 0; k < 3; ++k) {
    // A line along the axis itself: from diagonals alone nobody can tell which axis loses the motion.
    const bool seen = std::any_of(lines.begin(), lines.end(), [k](const CondensedLine& line) {
      return line.reversal.places.size() > 0 && std::abs(line.beam.direction[k]) > 0.999999;
    });
    if (!seen || !chain.has(k)) continue;
    axes.push_back({k});
    splines.emplace_back(travel[index(k)], pieces);
  }
  if (axes.empty()) return curves;
  std::vector<CondensedLine> used;
  for (const CondensedLine& line : lines) {
    bool known = true;
    for (int k = 0; k < 3; ++k)
      known = known && (std::abs(line.beam.direction[k]) < 1e-6 ||
                        std::any_of(axes.begin(), axes.end(), [k](const Waves& a) { return a.axis == k; }));
    if (known) used.push_back(line);
  }
  const Equations equations = equations_of(used, axes, splines);
  choose_waves(equations, axes, splines);
  for (std::size_t a = 0; a < axes.size(); ++a)
    curves[index(axes[a].axis)] = curve_of(averaged(equations, axes, a, splines), splines[a]);
  return curves;
}

}  // namespace invar::metrology
