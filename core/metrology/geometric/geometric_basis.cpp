#include "core/metrology/geometric/geometric_basis.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

/// Orthonormal basis of the coefficients that keep the gauge of an error motion.
Eigen::MatrixXd gauge_basis(const numerics::CubicBSpline& spline, double origin, bool no_slope) {
  const int n = spline.size();
  Eigen::MatrixXd constraint = Eigen::MatrixXd::Zero(n, no_slope ? 2 : 1);
  const auto add = [&](double place, int column, double sign) {
    const auto w = spline.at(place);
    for (int i = 0; i < 4; ++i) constraint(w.first + i, column) += sign * w.value[index(i)];
  };
  add(origin, 0, 1.0);
  if (no_slope) {
    add(spline.interval().upper, 1, 1.0);
    add(spline.interval().lower, 1, -1.0);
  }
  return numerics::full_q(constraint).rightCols(n - constraint.cols());
}

/// The largest arm a rotation of `error motion` can have within the travels, at any of the tools.
double largest_arm(const Chain& chain, const std::array<Range, 3>& ranges,
                   const std::vector<Eigen::Vector3d>& tools, int motion) {
  const int axis = axis_of(motion);
  const Eigen::Vector3d about = Eigen::Vector3d::Unit(direction_of(motion));
  double largest = 0.0;
  for (const Eigen::Vector3d& tool : tools) {
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::Vector3d position;
      for (int k = 0; k < 3; ++k)
        position[k] = (corner >> k) % 2 == 0 ? ranges[index(k)].lower : ranges[index(k)].upper;
      const Eigen::Vector3d arm = lever_arms(chain, Eigen::Matrix3d::Identity(), position, tool).col(axis);
      Eigen::Vector3d effect = about.cross(arm);
      for (int k = 0; k < 3; ++k)
        if (!chain.has(k)) effect[k] = 0.0;
      largest = std::max(largest, effect.norm());
    }
  }
  return largest;
}

}  // namespace

void GeometricBasis::add_expansion(double temperature) {
  reference_temperature = temperature;
  for (int k = 0; k < 3; ++k)
    if (chain.has(k)) expanding.push_back(k);
  size += static_cast<int>(expanding.size());
}

void GeometricBasis::set_waves(std::vector<AxisWave> found) {
  size += wave_unknowns * (static_cast<int>(found.size()) - static_cast<int>(waves.size()));
  waves = std::move(found);
}

AxisWave GeometricBasis::wave(std::size_t i, const Eigen::VectorXd& unknowns) const {
  AxisWave result = waves[i];
  const Eigen::Vector3d own = unknowns.segment<3>(first_wave() + wave_unknowns * static_cast<int>(i));
  result.cosine = own[0];
  result.sine = own[1];
  result.number += own[2];
  return result;
}

Eigen::RowVector3d GeometricBasis::wave_row(const AxisWave& wave, double q) const {
  const Range range = splines[index(wave.axis)].interval();
  const auto at = [&](double place) {
    const double u = range.clamp(place) - 0.5 * (range.lower + range.upper);
    const double c = std::cos(wave.number * u);
    const double s = std::sin(wave.number * u);
    return Eigen::RowVector3d{c, s, u * (wave.sine * c - wave.cosine * s)};
  };
  return at(q) - at(origin[index(wave.axis)]);
}

Eigen::VectorXd GeometricBasis::spline_coefficients(int motion, const Eigen::VectorXd& unknowns) const {
  for (const Block& block : blocks)
    if (block.motion == motion) return block.coefficients * unknowns.segment(block.first, block.size());
  return Eigen::VectorXd::Zero(splines[index(axis_of(motion))].size());
}

Squareness GeometricBasis::squareness(const Eigen::VectorXd& unknowns) const {
  Squareness result{};
  for (std::size_t i = 0; i < pairs.size(); ++i)
    result[index(pairs[i])] = unknowns[first_squareness() + static_cast<int>(i)];
  return result;
}

GeometricBasis make_basis(const Chain& chain, const std::array<Range, 3>& ranges,
                          const std::array<int, 3>& intervals, const std::vector<Eigen::Vector3d>& tools) {
  GeometricBasis basis;
  basis.chain = chain;
  for (int axis = 0; axis < 3; ++axis) {
    if (!chain.has(axis)) continue;
    const Range range = ranges[index(axis)];
    basis.splines[index(axis)] = numerics::CubicBSpline{range, intervals[index(axis)]};
    basis.origin[index(axis)] = range.contains(0.0) ? 0.0 : range.lower;
  }
  for (int motion = 0; motion < error_motion_count; ++motion) {
    const int axis = axis_of(motion);
    if (!chain.has(axis)) continue;
    if (is_rotation(motion) ? largest_arm(chain, ranges, tools, motion) < 1e-9
                            : !chain.has(direction_of(motion)))
      continue;
    GeometricBasis::Block block;
    block.motion = motion;
    block.first = basis.size;
    block.coefficients =
        gauge_basis(basis.splines[index(axis)], basis.origin[index(axis)], is_straightness(motion));
    basis.size += block.size();
    basis.blocks.push_back(std::move(block));
  }
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (chain.has(a) && chain.has(b)) basis.pairs.push_back(squareness_of(a, b));
  basis.size += static_cast<int>(basis.pairs.size());
  return basis;
}

std::vector<FieldTerm> field_terms(const GeometricBasis& basis, const Squareness& squareness,
                                   const Eigen::Vector3d& position, const Eigen::Vector3d& tool) {
  const Eigen::Matrix3d arms =
      lever_arms(basis.chain, axis_directions(basis.chain, squareness), position, tool);
  std::vector<FieldTerm> terms;
  for (std::size_t b = 0; b < basis.blocks.size(); ++b) {
    const int motion = basis.blocks[b].motion;
    const int axis = axis_of(motion);
    const Eigen::Vector3d along = Eigen::Vector3d::Unit(direction_of(motion));
    const Eigen::Vector3d effect = is_rotation(motion) ? Eigen::Vector3d{along.cross(arms.col(axis))} : along;
    if (effect.isZero(0.0)) continue;
    terms.push_back({b, effect, basis.splines[index(axis)].at(position[axis])});
  }
  return terms;
}

Eigen::MatrixXd squareness_map(const GeometricBasis& basis, const Squareness& squareness,
                               const Eigen::Vector3d& position) {
  const Eigen::Matrix3d directions = axis_directions(basis.chain, squareness);
  Eigen::MatrixXd map = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(basis.pairs.size()));
  for (std::size_t i = 0; i < basis.pairs.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      for (int b = a + 1; b < 3; ++b) {
        if (squareness_of(a, b) != basis.pairs[i]) continue;
        const int later = basis.chain.place(a) > basis.chain.place(b) ? a : b;
        const int towards = later == a ? b : a;
        const auto column = static_cast<Eigen::Index>(i);
        map(towards, column) = position[later];
        map(later, column) = -position[later] * squareness[index(basis.pairs[i])] / directions(later, later);
      }
    }
  }
  return map;
}

Eigen::MatrixXd field_map(const GeometricBasis& basis, const Squareness& squareness,
                          const Eigen::Vector3d& position, const Eigen::Vector3d& tool) {
  Eigen::MatrixXd map = Eigen::MatrixXd::Zero(3, basis.size);
  for (const FieldTerm& term : field_terms(basis, squareness, position, tool)) {
    const auto& block = basis.blocks[term.block];
    const auto& w = term.weights;
    Eigen::RowVectorXd row = w.value[0] * block.coefficients.row(w.first);
    for (int i = 1; i < 4; ++i) row += w.value[index(i)] * block.coefficients.row(w.first + i);
    for (int k = 0; k < 3; ++k)
      if (term.effect[k] != 0.0) map.row(k).segment(block.first, block.size()) = term.effect[k] * row;
  }
  for (std::size_t i = 0; i < basis.waves.size(); ++i) {
    const int axis = basis.waves[i].axis;
    map.row(axis).segment<3>(basis.first_wave() + wave_unknowns * static_cast<int>(i)) =
        basis.wave_row(basis.waves[i], position[axis]);
  }
  map.middleCols(basis.first_squareness(), static_cast<Eigen::Index>(basis.pairs.size())) =
      squareness_map(basis, squareness, position);
  return map;
}

Eigen::Vector3d squareness_remainder(const GeometricBasis& basis, const Squareness& squareness,
                                     const Eigen::Vector3d& position) {
  const Eigen::Matrix3d directions = axis_directions(basis.chain, squareness);
  Eigen::Vector3d remainder = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis)
    if (basis.chain.has(axis))
      remainder += position[axis] * (directions.col(axis) - Eigen::Vector3d::Unit(axis));
  Eigen::VectorXd unknowns = Eigen::VectorXd::Zero(basis.size);
  for (std::size_t i = 0; i < basis.pairs.size(); ++i)
    unknowns[basis.first_squareness() + static_cast<int>(i)] = squareness[index(basis.pairs[i])];
  return remainder - field_map(basis, squareness, position, Eigen::Vector3d::Zero()) * unknowns;
}

}  // namespace invar::metrology
