#include "core/vision/edge_filter.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::vision {

EdgeFilter::EdgeFilter(double blur_px, int half_px) : blur{blur_px}, half{half_px} {
  INVAR_EXPECTS(blur > 0.0 && half >= 3 && half <= most_half, blur, half);
  const int n = 2 * half + 1;
  Profile inner(n), outer(n);    // the ramps of slope inside and outside
  Eigen::MatrixXd design(n, 6);  // 1, S, g, inner, outer, dS/dblur
  for (int i = 0; i < n; ++i) {
    const double k = i - half, u = k / blur;
    const double density = std::exp(-0.5 * u * u) / (blur * std::sqrt(2.0 * std::numbers::pi));
    const double beyond = 0.5 * std::erfc(u / std::numbers::sqrt2);  // Phi(-u)
    inner(i) = k * beyond - blur * blur * density;  // a ramp on one side, blurred like the edge
    outer(i) = k * (1.0 - beyond) + blur * blur * density;
    design.row(i) << 1.0, beyond, density, inner(i), outer(i), density * u;
  }
  const auto inverse = [](const Eigen::MatrixXd& a) -> Eigen::MatrixXd {
    return numerics::solve_symmetric((a.transpose() * a), a.transpose());
  };
  // Samples to ground, contrast, contrast * offset; to these and the slopes; to these and the change of blur.
  const Eigen::MatrixXd step = inverse(design.leftCols(3)), sloped = inverse(design.leftCols(5));
  Eigen::MatrixXd with_blur(n, 4);
  with_blur << design.leftCols(3), design.col(5);
  const Eigen::MatrixXd spread = inverse(with_blur);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::array<double, rows> row{step(0, i),   step(1, i),   step(2, i),   inner(i),    outer(i),
                                       sloped(3, i), sloped(4, i), spread(1, i), spread(3, i)};
    for (std::size_t r = 0; r < rows; ++r)
      products[r][static_cast<std::size_t>(i)] = static_cast<float>(row[r]);
  }
  from_inner = step * inner;
  from_outer = step * outer;
  columns = design.leftCols(3).transpose() * design.leftCols(3);
  inner_inner = inner.squaredNorm();
  inner_outer = inner.dot(outer);
  outer_outer = outer.squaredNorm();
  spread_inner = {spread.row(1).dot(inner), spread.row(3).dot(inner)};
  spread_outer = {spread.row(1).dot(outer), spread.row(3).dot(outer)};
}

int EdgeFilter::half_for(double blur, double radius) {
  const int wanted = static_cast<int>(std::ceil(3.0 * blur)) + 3;
  const int room = std::max(3, static_cast<int>(0.45 * radius));
  return std::clamp(wanted, 3, std::min(room, most_half));
}

}  // namespace invar::vision
