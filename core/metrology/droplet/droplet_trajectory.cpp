#include "core/metrology/droplet/droplet_trajectory.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/base/angle.hpp"
#include "core/base/contract.hpp"
#include "core/metrology/droplet/droplet_fit.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

constexpr double chance_of_no_field = 1e-4;  // two tests, on droplets that the fits themselves chose

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

double DropletTrajectory::sigma(double height, const Eigen::Vector2d& aimed) const {
  const Eigen::Vector2d d = aimed - field_centre;
  return std::hypot(sigma(height), std::sqrt(std::max(0.0, d.dot(field_covariance * d))));
}

Eigen::Vector2d DropletTrajectory::aim(const Eigen::Vector2d& target, double height,
                                       const Eigen::Vector2d& stage_velocity) const {
  const Eigen::Matrix2d turned = Eigen::Matrix2d::Identity() + field;
  return field_centre + turned.inverse() * (target - field_centre - offset(height, stage_velocity));
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
        if (std::isfinite(drops.diameter(i)) && usual - drops.diameter(i) > 5.0 * spread) fit.kept(i) = 0.0;
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
  const Eigen::VectorXd sound = fit.kept;
  const DropletStart start{drops, offset, sound, from_median, group, levels};
  DropletForm form{.tilt = tilt, .delay = tilt && moving, .carry = moving};
  DropletFit robust = fit_robustly(start, form);
  for (const FieldForm field : {FieldForm::rotation_and_scale, FieldForm::any}) {
    DropletForm wider = form;
    wider.field = field;
    wider.centre = centre_of(drops.target, sound);
    if (!spans_field(drops.target, sound, field)) continue;
    DropletFit other = fit_robustly(start, wider);
    const double chance = chance_of_field(start, form, other, wider);
    if (chance >= chance_of_no_field) continue;
    form = wider;
    robust = std::move(other);
    fit.field_form = field;
    fit.field_probability = chance;
  }
  fit.kept = robust.kept;
  fit.scatter_at_nozzle = robust.at_nozzle;
  fit.scatter_per_height = robust.per_height;
  const DropletSolution& solution = robust.solution;
  const Eigen::Matrix2Xd& residual = robust.residual;
  fit.scatter = test_scatter(start, form, robust);
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
  if (form.field != FieldForm::none) {
    const Eigen::Index at = form.field_begin();
    const auto numbers = solution.theta.segment(at, form.field_columns());
    const auto covariance = solution.covariance.block(at, at, form.field_columns(), form.field_columns());
    path.field_centre = form.centre;
    if (form.field == FieldForm::any) {
      path.field << numbers(0), numbers(1), numbers(2), numbers(3);
      path.field_covariance = covariance.topLeftCorner<2, 2>();
    } else {
      path.field << numbers(0), -numbers(1), numbers(1), numbers(0);
      path.field_covariance = covariance(0, 0) * Eigen::Matrix2d::Identity();
    }
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
