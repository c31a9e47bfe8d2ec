// GeometricBasis: the unknowns of a machine's geometric error, and the linear map from them to the error field.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/volumetric.hpp"
#include "core/numerics/bspline.hpp"

namespace invar::metrology {

/// A periodic error of positioning, as a screw's: cosine cos(number u) + sine sin(number u), u from mid travel. Its unknowns
/// are cosine, sine and, about the number given, how far off that is.
struct AxisWave {
  int axis = 0;
  double number = 0.0;  // rad/m
  double cosine = 0.0;  // m, about which the number's own effect is taken
  double sine = 0.0;    // m
  [[nodiscard]] double period() const { return 6.283185307179586 / number; }  // m
};
inline constexpr int wave_unknowns = 3;

/// Cubic B-splines of every error motion that can show, in the canonical gauge (docs/explanation/geometric.md#gauge).
/// Each motion is zero at the origin of its axis, and straightness has no end-point slope. Three squareness
/// constants hold the rest. Displacements cannot see rigid motions of the frame; this gauge is one choice among
/// them.
struct GeometricBasis {
  struct Block {
    int motion = 0;
    int first = 0;                 // of its unknowns
    Eigen::MatrixXd coefficients;  // spline size x unknowns: orthonormal columns that keep the gauge
    [[nodiscard]] int size() const { return static_cast<int>(coefficients.cols()); }
  };

  Chain chain;
  std::array<numerics::CubicBSpline, 3> splines;  // by axis letter
  std::array<double, 3> origin{};                 // m, of the gauge
  std::vector<Block> blocks;
  std::vector<AxisWave> waves;  // after the blocks, three unknowns each
  std::vector<int> pairs;       // squareness constants, after the waves
  std::vector<int>
      expanding;  // axes with an expansion coefficient [1/K], after the squareness; none without temperatures
  double reference_temperature = 0.0;  // degC, at which all the others hold
  int size = 0;                        // unknowns in all

  [[nodiscard]] int first_wave() const {
    return first_squareness() - wave_unknowns * static_cast<int>(waves.size());
  }
  [[nodiscard]] int first_squareness() const { return first_expansion() - static_cast<int>(pairs.size()); }
  [[nodiscard]] int first_expansion() const { return size - static_cast<int>(expanding.size()); }
  /// One more unknown an axis of the chain.
  void add_expansion(double reference_temperature);
  void set_waves(std::vector<AxisWave> found);
  /// A wave as found: its numbers by `unknowns`, the change of the number taken in.
  [[nodiscard]] AxisWave wave(std::size_t i, const Eigen::VectorXd& unknowns) const;
  /// Effect of a wave's unknowns on positioning at `q` [m]: zero at the origin of the axis.
  [[nodiscard]] Eigen::RowVector3d wave_row(const AxisWave& wave, double q) const;
  /// Coefficients of an error motion's spline; zeros for one that cannot show.
  [[nodiscard]] Eigen::VectorXd spline_coefficients(int motion, const Eigen::VectorXd& unknowns) const;
  [[nodiscard]] Squareness squareness(const Eigen::VectorXd& unknowns) const;
};

/// Error motions whose lever arms vanish for every one of `tools` [m] are left out: at zero offset a chain of three axes
/// shows 14 of its 18. `ranges` [m] are the axes' travels (with the measured points inside), `intervals` the spline
/// pieces of each axis.
GeometricBasis make_basis(const Chain& chain, const std::array<Range, 3>& ranges,
                          const std::array<int, 3>& intervals, const std::vector<Eigen::Vector3d>& tools);

/// Effect of one unit of the error motion of `blocks[block]` on the tool, and the coefficients of its spline that count there.
struct FieldTerm {
  std::size_t block;
  Eigen::Vector3d effect;  // m per m, or the arm in m per rad
  numerics::CubicBSpline::Weights weights;
};
std::vector<FieldTerm> field_terms(const GeometricBasis& basis, const Squareness& squareness,
                                   const Eigen::Vector3d& position, const Eigen::Vector3d& tool);

/// Effect of each squareness of `pairs` on the tool, to first order about the given squareness: 3 x pairs.
Eigen::MatrixXd squareness_map(const GeometricBasis& basis, const Squareness& squareness,
                               const Eigen::Vector3d& position);

/// e(P, p) = V * unknowns at the reference temperature, to first order about the given squareness: 3 x size. With `squareness` not zero the constant
/// remainder is `squareness_remainder`.
Eigen::MatrixXd field_map(const GeometricBasis& basis, const Squareness& squareness,
                          const Eigen::Vector3d& position, const Eigen::Vector3d& tool);

/// Error of the linear form in the squareness at `position` [m]: exact axis directions minus their tangent.
Eigen::Vector3d squareness_remainder(const GeometricBasis& basis, const Squareness& squareness,
                                     const Eigen::Vector3d& position);

}  // namespace invar::metrology
