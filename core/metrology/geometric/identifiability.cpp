#include "core/metrology/geometric/identifiability.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/metrology/geometric/geometric_field.hpp"

namespace invar::metrology {

namespace {

constexpr double open_alone = 0.9;    // share of the prior variance above which nothing is known
constexpr double open_in_part = 0.2;  // above which a good part is open
constexpr double coupled = 0.25;      // correlation that joins two error motions to one combination

/// Rows that evaluate a block at its spline's knots.
Eigen::MatrixXd at_knots(const GeometricBasis& basis, const GeometricBasis::Block& block) {
  const auto& spline = basis.splines[static_cast<std::size_t>(axis_of(block.motion))];
  Eigen::MatrixXd rows(spline.intervals() + 1, block.size());
  for (int i = 0; i <= spline.intervals(); ++i) {
    const auto w = spline.at(spline.interval().lower + i * spline.spacing());
    rows.row(i).setZero();
    for (int k = 0; k < 4; ++k)
      rows.row(i) += w.value[static_cast<std::size_t>(k)] * block.coefficients.row(w.first + k);
  }
  return rows;
}

double volumetric(const GeometricBasis& basis, const Eigen::MatrixXd& covariance,
                  const Squareness& squareness, const std::array<Range, 3>& travel,
                  const Eigen::Vector3d& tool) {
  const RigidPart rigid = rigid_part(basis, squareness, volume_grid(basis.chain, travel, 5), tool);
  const FieldVariance variance{basis, squareness, rigid, covariance};
  double sum = 0.0;
  for (const auto& node : volume_nodes(basis.chain, travel))
    sum += node.weight * variance.at(node.position, tool).sum();
  return std::sqrt(sum);
}

}  // namespace

std::string Unidentified::words() const {
  std::string names;
  for (const auto& name : components) names += (names.empty() ? "" : " with ") + name;
  if (components.size() > 1) return names + ": the lines show only a combination of them";
  return left > open_alone ? names + ": no line shows it" : names + ": shown in part only";
}

Identifiability identifiability(const GeometricBasis& basis, const Posterior& posterior,
                                const Squareness& squareness, const std::array<Range, 3>& travel,
                                const Eigen::Vector3d& tool) {
  Identifiability result;
  const Eigen::MatrixXd& told = posterior.widened.size() > 0 ? posterior.widened : posterior.covariance;
  std::vector<Eigen::MatrixXd> scaled;  // rows at knots over the error motion's prior sd
  std::vector<int> first;
  for (const auto& block : basis.blocks) {
    const Eigen::MatrixXd rows = at_knots(basis, block);
    const auto part = [&](const Eigen::MatrixXd& covariance) {
      return (rows * covariance.block(block.first, block.first, block.size(), block.size()))
          .cwiseProduct(rows)
          .sum();
    };
    const double before = part(posterior.prior_covariance);
    const double after = part(posterior.covariance);
    result.components.push_back({std::string{iso_name(block.motion)}, std::min(after / before, 1.0),
                                 std::sqrt(part(told) / static_cast<double>(rows.rows()))});
    scaled.push_back(rows / std::sqrt(before));
    first.push_back(block.first);
  }
  for (std::size_t i = 0; i < basis.pairs.size(); ++i) {
    const Eigen::Index k = basis.first_squareness() + static_cast<Eigen::Index>(i);
    const double before = posterior.prior_covariance(k, k);
    const double after = posterior.covariance(k, k);
    // Its prior is very wide, so a tenth of the standard deviation left is much already.
    result.components.push_back({std::string{squareness_iso_name(basis.pairs[i])},
                                 std::min(std::sqrt(after / before), 1.0), std::sqrt(told(k, k))});
    scaled.push_back(Eigen::MatrixXd::Constant(1, 1, 1.0 / std::sqrt(before)));
    first.push_back(static_cast<int>(k));
  }
  // Error motions that are open in part and hang together make one combination.
  const std::size_t count = result.components.size();
  std::vector<std::size_t> group(count);
  std::iota(group.begin(), group.end(), std::size_t{0});
  const auto cross = [&](std::size_t a, std::size_t b) {
    return (scaled[a] * posterior.covariance.block(first[a], first[b], scaled[a].cols(), scaled[b].cols()) *
            scaled[b].transpose())
        .norm();
  };
  const auto is_open = [&](std::size_t i) {
    return result.components[i].left > open_in_part && result.components[i].left <= open_alone;
  };
  for (std::size_t a = 0; a < count; ++a) {
    if (!is_open(a)) continue;
    for (std::size_t b = 0; b < a; ++b) {
      if (!is_open(b) || cross(a, b) < coupled * std::sqrt(cross(a, a) * cross(b, b))) continue;
      const std::size_t from = group[a];
      for (auto& g : group)
        if (g == from) g = group[b];
    }
  }
  for (std::size_t g = 0; g < count; ++g) {
    Unidentified one;
    one.left = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (group[i] != g || result.components[i].left <= open_in_part) continue;
      one.components.push_back(result.components[i].name);
      one.left = std::max(one.left, result.components[i].left);
    }
    if (!one.components.empty()) result.unidentified.push_back(std::move(one));
  }
  std::stable_sort(result.unidentified.begin(), result.unidentified.end(),
                   [](const auto& a, const auto& b) { return a.left > b.left; });
  result.volumetric_rms = volumetric(basis, told, squareness, travel, tool);
  result.volumetric_rms_prior = volumetric(basis, posterior.prior_covariance, squareness, travel, tool);
  return result;
}

}  // namespace invar::metrology
