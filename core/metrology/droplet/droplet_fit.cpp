#include "core/metrology/droplet/droplet_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/numerics/decompositions.hpp"
#include "core/numerics/robust.hpp"
#include "core/numerics/significance.hpp"

namespace invar::metrology {

namespace {

/// The columns of both components of a droplet.
Eigen::Matrix<double, 2, Eigen::Dynamic> columns_of(const Droplets& drops, Eigen::Index i,
                                                    const DropletForm& form) {
  const Eigen::Index columns = form.columns();
  Eigen::Matrix<double, 2, Eigen::Dynamic> rows = Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, columns);
  rows.leftCols<2>().setIdentity();
  if (form.tilt) rows.middleCols<2>(2) = drops.height(i) * Eigen::Matrix2d::Identity();
  rows.middleCols(form.field_begin(), form.field_columns()) =
      form.field_at(drops.target.col(i) - form.centre);
  if (form.delay) rows.col(columns - 2) = drops.stage_velocity.col(i);
  if (form.carry) rows.col(columns - 1) = drops.height(i) * drops.stage_velocity.col(i);
  return rows;
}

/// Rows of both components of each kept droplet, weighted.
DropletSolution solve(const Droplets& drops, const Eigen::Matrix2Xd& offset, const Eigen::VectorXd& kept,
                      const Eigen::VectorXd& deviation, const DropletForm& form) {
  const Eigen::Index n = drops.height.size();
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, form.columns());
  Eigen::VectorXd y = Eigen::VectorXd::Zero(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (kept(i) <= 0.0) continue;
    a.middleRows<2>(2 * i) = columns_of(drops, i, form) / deviation(i);
    y.segment<2>(2 * i) = offset.col(i) / deviation(i);
  }
  DropletSolution solution;
  // Heights are a thousandth of what placements are counted in: scale the columns before the decomposition.
  const Eigen::VectorXd scale = a.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = a * scale.cwiseInverse().asDiagonal();
  solution.theta = numerics::least_squares(scaled, y).cwiseQuotient(scale);
  const Eigen::MatrixXd inverse = numerics::pseudo_inverse(scaled.transpose() * scaled);
  solution.covariance = scale.cwiseInverse().asDiagonal() * inverse * scale.cwiseInverse().asDiagonal();
  return solution;
}

Eigen::Matrix2Xd predicted(const Droplets& drops, const Eigen::VectorXd& theta, const DropletForm& form) {
  Eigen::Matrix2Xd offset(2, drops.height.size());
  for (Eigen::Index i = 0; i < drops.height.size(); ++i) offset.col(i) = columns_of(drops, i, form) * theta;
  return offset;
}

/// Scatter of one component in each height's group, from the kept droplets (mean taken off, so n - 1).
void scatter_model(const Eigen::Matrix2Xd& residual, const Eigen::VectorXd& kept,
                   const std::vector<int>& group, const std::vector<double>& levels, double& at_nozzle,
                   double& per_height) {
  // var = s0^2 + (s1 h)^2, by weighted least squares over the groups, both not negative.
  double sw = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  double pooled = 0.0;
  double pooled_count = 0.0;
  for (std::size_t g = 0; g < levels.size(); ++g) {
    double squares = 0.0;
    double count = 0.0;
    for (Eigen::Index i = 0; i < residual.cols(); ++i)
      if (group[static_cast<std::size_t>(i)] == static_cast<int>(g) && kept(i) > 0.0) {
        squares += residual.col(i).squaredNorm();
        count += 2.0;
      }
    pooled += squares;
    pooled_count += count;
    if (count < 4.0) continue;
    const double variance = std::max(squares / (count - 2.0), 1e-18);
    const double weight = count / (variance * variance);
    const double x = levels[g] * levels[g];
    sw += weight, sx += weight * x, sy += weight * variance, sxx += weight * x * x,
        sxy += weight * x * variance;
  }
  const double flat = pooled / std::max(pooled_count - 2.0, 1.0);
  at_nozzle = std::sqrt(std::max(flat, 1e-18));
  per_height = 0.0;
  const double determinant = sw * sxx - sx * sx;
  if (determinant <= 1e-9 * sw * sxx) return;  // one height
  double slope = (sw * sxy - sx * sy) / determinant;
  double constant = (sy - slope * sx) / sw;
  if (slope <= 0.0) {
    slope = 0.0;
    constant = sy / sw;
  } else if (constant < 0.0) {
    constant = 0.0;
    slope = sxy / sxx;
  }
  at_nozzle = std::sqrt(std::max(constant, 1e-18));
  per_height = std::sqrt(slope);
}

/// Rejects by distance in units of the height's own robust scatter (Rayleigh: 3.9 sigma in a plane is 1 in 2000).
Eigen::VectorXd judged(const DropletStart& start, const Eigen::Matrix2Xd& residual) {
  const Eigen::Index n = residual.cols();
  std::vector<double> level_scatter(start.levels.size(), 0.0);
  std::vector<double> all;
  for (std::size_t g = 0; g < start.levels.size(); ++g) {
    std::vector<double> components;
    for (Eigen::Index i = 0; i < n; ++i)
      if (start.group[static_cast<std::size_t>(i)] == static_cast<int>(g) && start.sound(i) > 0.0)
        components.insert(components.end(), {residual(0, i), residual(1, i)});
    all.insert(all.end(), components.begin(), components.end());
    const auto count = static_cast<double>(components.size()) / 2.0;
    if (count < 3.0) continue;  // too few to judge by themselves
    // Few droplets tell their scatter badly: correct for the median that was taken off.
    level_scatter[g] =
        numerics::robust_deviation(components, 0.0) * std::sqrt(count / (count - 1.0)) * (1.0 + 1.0 / count);
  }
  const double typical = std::max(2.0 * numerics::robust_deviation(all, 0.0), 1e-7);
  Eigen::VectorXd kept(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double own = level_scatter[static_cast<std::size_t>(start.group[static_cast<std::size_t>(i)])];
    const double scale = own > 0.0 ? std::max(own, 0.1 * typical) : typical;
    kept(i) = start.sound(i) > 0.0 && residual.col(i).norm() <= 3.9 * scale ? 1.0 : 0.0;
  }
  return kept;
}

/// Weighted squares that a form leaves of the droplets that a fit kept.
double squares_left(const DropletStart& start, const DropletForm& form, const DropletFit& by) {
  const DropletSolution solution = solve(start.drops, start.offset, by.kept, by.deviation, form);
  const Eigen::Matrix2Xd residual = start.offset - predicted(start.drops, solution.theta, form);
  return (residual.colwise().squaredNorm().transpose().array() * by.kept.array() /
          by.deviation.array().square())
      .sum();
}

}  // namespace

DropletFit fit_robustly(const DropletStart& start, const DropletForm& form) {
  const Eigen::Index n = start.offset.cols();
  DropletFit fit;
  fit.deviation = Eigen::VectorXd::Ones(n);
  fit.residual = start.from_median;
  const auto again = [&](const Eigen::VectorXd& kept) {
    fit.solution = solve(start.drops, start.offset, kept, fit.deviation, form);
    fit.residual = start.offset - predicted(start.drops, fit.solution.theta, form);
  };
  // Where droplets are carried to both sides, or turned about a centre, there is no middle: least sum of distances over
  // the whole model.
  for (int round = 0; (form.carry || form.field != FieldForm::none) && round < 30; ++round) {
    again(start.sound);
    fit.deviation = fit.residual.colwise().norm().cwiseMax(1e-8).cwiseSqrt();
  }
  for (int round = 0; round < 6; ++round) {
    fit.kept = judged(start, fit.residual);
    if (fit.kept.sum() < (form.tilt ? 2.0 : 1.0)) fit.kept = start.sound;
    scatter_model(fit.residual, fit.kept, start.group, start.levels, fit.at_nozzle, fit.per_height);
    for (Eigen::Index i = 0; i < n; ++i)
      fit.deviation(i) = std::hypot(fit.at_nozzle, fit.per_height * start.drops.height(i));
    again(fit.kept);
  }
  return fit;
}

Eigen::Vector2d centre_of(const Eigen::Matrix2Xd& target, const Eigen::VectorXd& sound) {
  return (target * sound) / sound.sum();
}

bool spans_field(const Eigen::Matrix2Xd& target, const Eigen::VectorXd& sound, FieldForm field) {
  constexpr double flattest = 0.05;
  const Eigen::Matrix2Xd apart =
      (target.colwise() - centre_of(target, sound)) * sound.cwiseSqrt().asDiagonal();
  const Eigen::Vector2d spread = numerics::singular_values(apart);
  if (spread(0) <= 1e-9 || sound.sum() < 6.0) return false;
  return field != FieldForm::any || spread(1) > flattest * spread(0);
}

double chance_of_field(const DropletStart& start, const DropletForm& form, const DropletFit& by,
                       const DropletForm& wider) {
  return numerics::chance_of_gain(squares_left(start, form, by), squares_left(start, wider, by),
                                  static_cast<double>(wider.columns() - form.columns()),
                                  2.0 * by.kept.sum() - static_cast<double>(wider.columns()));
}

ScatterTest test_scatter(const DropletStart& start, const DropletForm& form, const DropletFit& fit) {
  constexpr Eigen::Index curved = 10;  // linear field, then x^2, xy, y^2 of either component
  ScatterTest test;
  const auto count = static_cast<Eigen::Index>(fit.kept.sum());
  const Eigen::Index freedom = 2 * count - form.columns() - curved;
  if (freedom < 6) return test;
  Eigen::MatrixXd rows(2 * count, form.columns() + curved);
  Eigen::VectorXd left(2 * count);
  const Eigen::Vector2d centre = centre_of(start.drops.target, start.sound);
  const double reach = std::max((start.drops.target.colwise() - centre).cwiseAbs().maxCoeff(), 1e-9);
  std::vector<double> in_order[2];
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < fit.kept.size(); ++i) {
    if (fit.kept(i) <= 0.0) continue;
    const Eigen::Vector2d d = (start.drops.target.col(i) - centre) / reach;
    Eigen::Matrix<double, 1, curved / 2> shape;
    shape << d.x(), d.y(), d.x() * d.x(), d.x() * d.y(), d.y() * d.y();
    rows.middleRows<2>(next).leftCols(form.columns()) = columns_of(start.drops, i, form) / fit.deviation(i);
    rows.middleRows<2>(next).rightCols(curved).setZero();
    rows.row(next).segment(form.columns(), curved / 2) = shape / fit.deviation(i);
    rows.row(next + 1).tail(curved / 2) = shape / fit.deviation(i);
    left.segment<2>(next) = fit.residual.col(i) / fit.deviation(i);
    for (Eigen::Index k = 0; k < 2; ++k) in_order[k].push_back(left(next + k));
    next += 2;
  }
  const Eigen::VectorXd scale = rows.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = rows * scale.cwiseInverse().asDiagonal();
  const Eigen::VectorXd found = rows * numerics::least_squares(scaled, left).cwiseQuotient(scale);
  const Eigen::Index rank = numerics::rank_of(scaled);
  const auto extra = static_cast<double>(rank - std::min(form.columns(), rank));
  const double with = (left - found).squaredNorm();
  const double by_field =
      numerics::chance_of_gain(left.squaredNorm(), with, extra, static_cast<double>(2 * count - rank));
  const double by_order = std::min(numerics::chance_of_alike_neighbours(in_order[0]),
                                   numerics::chance_of_alike_neighbours(in_order[1]));
  test.tested = true;
  test.probability = std::min(1.0, 3.0 * std::min(by_field, by_order));  // three tests
  test.pattern = by_field <= by_order ? "a field that is curved over the targets"
                                      : "something that goes on from one droplet to the next";
  test.explained_rms = std::sqrt(std::max(0.0, left.squaredNorm() - with) / static_cast<double>(count)) *
                       fit.deviation.dot(fit.kept) / static_cast<double>(count);
  return test;
}

}  // namespace invar::metrology
