#include "core/metrology/droplet_trajectory.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "core/base/contract.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// Groups of equal height: indices by the group's number; heights within 1 % of the largest are one.
std::vector<int> height_groups(const Eigen::VectorXd& height, std::vector<double>& levels) {
  std::vector<double> sorted{height.begin(), height.end()};
  std::sort(sorted.begin(), sorted.end());
  const double close = std::max(0.01 * std::abs(sorted.back()), 1e-9);
  for (const double h : sorted)
    if (levels.empty() || h - levels.back() > close) levels.push_back(h);
  std::vector<int> group;
  for (const double h : height) {
    std::size_t g = 0;
    while (g + 1 < levels.size() && h >= levels[g + 1]) ++g;
    group.push_back(static_cast<int>(g));
  }
  return group;
}

/// The point that minimises the sum of distances (Weiszfeld), which nearly half of outliers do not carry away.
Eigen::Vector2d spatial_median(const Eigen::Matrix2Xd& points, const std::vector<Eigen::Index>& rows) {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  std::array<std::vector<double>, 2> values;
  for (const Eigen::Index i : rows)
    for (std::size_t k = 0; k < 2; ++k) values[k].push_back(points(static_cast<Eigen::Index>(k), i));
  at << numerics::median(values[0]), numerics::median(values[1]);
  for (int round = 0; round < 50; ++round) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double total = 0.0;
    for (const Eigen::Index i : rows) {
      const double weight = 1.0 / std::max((points.col(i) - at).norm(), 1e-9);
      sum += weight * points.col(i);
      total += weight;
    }
    at = sum / total;
  }
  return at;
}

/// Which columns there are beside the placement: slope x, y; delay; slowness (in this order).
struct Form {
  bool tilt = false;
  bool delay = false;
  bool carry = false;
  [[nodiscard]] Eigen::Index columns() const {
    return 2 + (tilt ? 2 : 0) + (delay ? 1 : 0) + (carry ? 1 : 0);
  }
};

struct Solution {
  Eigen::VectorXd theta;
  Eigen::MatrixXd covariance;  // for unit weights' variance
};

/// Rows of both components of each kept droplet, weighted.
Solution solve(const Droplets& drops, const Eigen::Matrix2Xd& offset, const Eigen::VectorXd& kept,
               const Eigen::VectorXd& deviation, const Form& form) {
  const Eigen::Index n = drops.height.size();
  const Eigen::Index columns = form.columns();
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, columns);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (kept(i) <= 0.0) continue;
    for (Eigen::Index k = 0; k < 2; ++k) {
      const double weight = 1.0 / deviation(i);
      a(2 * i + k, k) = weight;
      if (form.tilt) a(2 * i + k, 2 + k) = weight * drops.height(i);
      if (form.delay) a(2 * i + k, columns - 2) = weight * drops.stage_velocity(k, i);
      if (form.carry) a(2 * i + k, columns - 1) = weight * drops.height(i) * drops.stage_velocity(k, i);
      y(2 * i + k) = weight * offset(k, i);
    }
  }
  Solution solution;
  // Heights are a thousandth of what placements are counted in: scale the columns before the decomposition.
  const Eigen::VectorXd scale = a.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = a * scale.cwiseInverse().asDiagonal();
  solution.theta = scaled.colPivHouseholderQr().solve(y).cwiseQuotient(scale);
  const Eigen::MatrixXd inverse =
      (scaled.transpose() * scaled).completeOrthogonalDecomposition().pseudoInverse();
  solution.covariance = scale.cwiseInverse().asDiagonal() * inverse * scale.cwiseInverse().asDiagonal();
  return solution;
}

Eigen::Matrix2Xd predicted(const Droplets& drops, const Eigen::VectorXd& theta, const Form& form) {
  Eigen::Matrix2Xd offset(2, drops.height.size());
  for (Eigen::Index i = 0; i < drops.height.size(); ++i) {
    Eigen::Vector2d at = theta.head<2>();
    if (form.tilt) at += drops.height(i) * theta.segment<2>(2);
    if (form.delay) at += theta(theta.size() - 2) * drops.stage_velocity.col(i);
    if (form.carry) at += drops.height(i) * theta(theta.size() - 1) * drops.stage_velocity.col(i);
    offset.col(i) = at;
  }
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

std::string text(const char* format, double a, double b = 0.0) {
  std::array<char, 200> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, a, b);
  return buffer.data();
}

}  // namespace

double DropletTrajectory::sigma(double height) const {
  const Eigen::Vector2d row{1.0, height};
  return std::sqrt(std::max(0.0, row.dot(covariance * row)));
}

double DropletTrajectory::tilt() const { return std::atan(slope.norm()); }
double DropletTrajectory::azimuth() const { return std::atan2(slope(1), slope(0)); }

DropletStatistics droplet_statistics(const Eigen::Ref<const Eigen::VectorXd>& diameters) {
  DropletStatistics result;
  result.count = diameters.size();
  const auto n = static_cast<double>(result.count);
  result.mean = diameters.mean();
  result.deviation = std::sqrt((diameters.array() - result.mean).square().sum() / (n - 1.0));
  result.mean_error = result.deviation / std::sqrt(n);
  const Eigen::ArrayXd apart = (diameters.array() - result.mean).abs();
  result.within_one = (apart <= result.deviation).cast<double>().mean();
  result.within_two = (apart <= 2.0 * result.deviation).cast<double>().mean();
  const auto normality = numerics::anderson_darling({diameters.begin(), diameters.end()});
  result.anderson_darling = normality.statistic;
  result.probability = normality.probability;
  return result;
}

TrajectoryFit identify_trajectory(const Droplets& drops) {
  const Eigen::Index n = drops.height.size();
  INVAR_EXPECTS(n >= 1 && drops.target.cols() == n && drops.landed.cols() == n, n);
  TrajectoryFit fit;
  const Eigen::Matrix2Xd offset = drops.landed - drops.target;
  std::vector<double> levels;
  const std::vector<int> group = height_groups(drops.height, levels);
  const bool tilt = levels.size() >= 2;
  // One velocity for all is no information: what it adds cannot be told from placement and tilt.
  bool moved = false, moving = false;
  if (drops.stage_velocity.cols() == n) {
    const Eigen::Vector2d mean = drops.stage_velocity.rowwise().mean();
    const double largest = drops.stage_velocity.cwiseAbs().maxCoeff();
    moved = largest > 1e-6;
    moving = moved && (drops.stage_velocity.colwise() - mean).cwiseAbs().maxCoeff() > 0.05 * largest;
  }
  const Form form{.tilt = tilt, .delay = tilt && moving, .carry = moving};
  fit.kept = Eigen::VectorXd::Ones(n);

  // A satellite is far smaller than its fellows.
  if (drops.diameter.size() == n) {
    std::vector<double> sizes;
    for (const double d : drops.diameter)
      if (std::isfinite(d)) sizes.push_back(d);
    if (sizes.size() >= 4) {
      const double usual = numerics::median(sizes);
      const double spread = std::max(numerics::robust_deviation(sizes, usual), 0.02 * usual);
      for (Eigen::Index i = 0; i < n; ++i)
        if (std::isfinite(drops.diameter(i)) && std::abs(drops.diameter(i) - usual) > 5.0 * spread)
          fit.kept(i) = 0.0;
    }
  }
  if (fit.kept.sum() < 1.0) fit.kept.setOnes();

  // Begin from each height's spatial median, so that satellites do not carry the first fit away.
  Eigen::Matrix2Xd from_median(2, n);
  for (std::size_t g = 0; g < levels.size(); ++g) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < n; ++i)
      if (group[static_cast<std::size_t>(i)] == static_cast<int>(g) && fit.kept(i) > 0.0) rows.push_back(i);
    if (rows.empty()) continue;
    const Eigen::Vector2d middle = spatial_median(offset, rows);
    for (Eigen::Index i = 0; i < n; ++i)
      if (group[static_cast<std::size_t>(i)] == static_cast<int>(g))
        from_median.col(i) = offset.col(i) - middle;
  }
  Eigen::VectorXd deviation = Eigen::VectorXd::Ones(n);
  const Eigen::VectorXd sound = fit.kept;
  Eigen::Matrix2Xd residual = from_median;
  Solution solution;
  // Where the stage carries droplets to both sides there is no middle: least sum of distances over the whole model.
  for (int round = 0; moving && round < 30; ++round) {
    solution = solve(drops, offset, sound, deviation, form);
    residual = offset - predicted(drops, solution.theta, form);
    deviation = residual.colwise().norm().cwiseMax(1e-8).cwiseSqrt();
  }
  for (int round = 0; round < 6; ++round) {
    // Reject by distance in units of the height's own robust scatter (Rayleigh: 3.9 sigma in a plane is 1 in 2000).
    std::vector<double> level_scatter(levels.size(), 0.0);
    std::vector<double> all;
    for (std::size_t g = 0; g < levels.size(); ++g) {
      std::vector<double> components;
      for (Eigen::Index i = 0; i < n; ++i)
        if (group[static_cast<std::size_t>(i)] == static_cast<int>(g) && sound(i) > 0.0)
          components.insert(components.end(), {residual(0, i), residual(1, i)});
      all.insert(all.end(), components.begin(), components.end());
      const auto count = static_cast<double>(components.size()) / 2.0;
      if (count < 3.0) continue;  // too few to judge by themselves
      // Few droplets tell their scatter badly: correct for the median that was taken off.
      level_scatter[g] = numerics::robust_deviation(components, 0.0) * std::sqrt(count / (count - 1.0)) *
                         (1.0 + 1.0 / count);
    }
    const double typical = std::max(2.0 * numerics::robust_deviation(all, 0.0), 1e-7);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double own = level_scatter[static_cast<std::size_t>(group[static_cast<std::size_t>(i)])];
      const double scale = own > 0.0 ? std::max(own, 0.1 * typical) : typical;
      fit.kept(i) = sound(i) > 0.0 && residual.col(i).norm() <= 3.9 * scale ? 1.0 : 0.0;
    }
    if (fit.kept.sum() < (tilt ? 2.0 : 1.0)) fit.kept = sound;
    scatter_model(residual, fit.kept, group, levels, fit.scatter_at_nozzle, fit.scatter_per_height);
    for (Eigen::Index i = 0; i < n; ++i)
      deviation(i) = std::hypot(fit.scatter_at_nozzle, fit.scatter_per_height * drops.height(i));
    solution = solve(drops, offset, fit.kept, deviation, form);
    residual = offset - predicted(drops, solution.theta, form);
  }
  fit.residual = residual;

  DropletTrajectory& path = fit.trajectory;
  path.placement = solution.theta.head<2>();
  path.covariance(0, 0) = solution.covariance(0, 0);
  if (tilt) {
    path.slope = solution.theta.segment<2>(2);
    path.covariance << solution.covariance(0, 0), solution.covariance(0, 2), solution.covariance(2, 0),
        solution.covariance(2, 2);
    const double slope_sigma = std::sqrt(solution.covariance(2, 2));
    fit.tilt_sigma = slope_sigma;
    fit.azimuth_sigma = slope_sigma / std::max(path.slope.norm(), 1e-300);
    if (path.slope.norm() < 2.0 * slope_sigma)
      fit.notes.push_back(text("the tilt of %.3f deg is within two standard deviations (%.3f deg) of none",
                               path.tilt() / degree, 2.0 * slope_sigma / degree));
  } else {
    // At another height the unknown tilt acts over the difference: a degree is what heads are mounted to.
    const double unknown = std::tan(1.0 * degree);
    const double h = levels.front();
    path.covariance(0, 0) += unknown * unknown * h * h;
    path.covariance(1, 1) = unknown * unknown;
    path.covariance(0, 1) = path.covariance(1, 0) = -unknown * unknown * h;
    fit.unidentified.emplace_back("placement and tilt apart: all droplets fell from one height");
    fit.notes.push_back(
        text("the offset holds for a height of %.2f mm; print at a second height to tell "
             "placement from tilt",
             1e3 * h));
  }
  if (moving) {
    path.slowness = solution.theta(solution.theta.size() - 1);
    path.slowness_sigma =
        std::sqrt(solution.covariance(solution.theta.size() - 1, solution.theta.size() - 1));
  } else if (moved) {
    fit.unidentified.emplace_back("carry by the stage: all droplets were jetted at one velocity");
  }
  if (form.delay) {
    path.delay = solution.theta(solution.theta.size() - 2);
    path.delay_sigma = std::sqrt(solution.covariance(solution.theta.size() - 2, solution.theta.size() - 2));
  }
  path.least_height = drops.height.minCoeff();
  path.most_height = drops.height.maxCoeff();

  double before = 0.0;
  double after = 0.0;
  double count = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (fit.kept(i) <= 0.0) continue;
    before += offset.col(i).squaredNorm();
    after += residual.col(i).squaredNorm();
    count += 1.0;
  }
  const double parameters = static_cast<double>(solution.theta.size()) / 2.0;
  fit.before_rms = std::sqrt(before / count);
  // Least squares looks better on its own droplets than on the next ones: n / (n - p) in each direction.
  fit.after_rms = count > parameters + 0.5
                      ? std::sqrt(after / count) * std::sqrt((count + parameters) / (count - parameters))
                      : std::numeric_limits<double>::quiet_NaN();
  return fit;
}

}  // namespace invar::metrology
