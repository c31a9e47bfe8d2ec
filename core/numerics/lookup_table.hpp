// LookupTable: a function of up to three inputs on a uniform grid, interpolated linearly; for the loop.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "core/base/range.hpp"
#include "core/numerics/rbf_network.hpp"

namespace invar::numerics {

/// One axis of the grid: `count` nodes from `range.lower` to `range.upper`.
struct GridAxis {
  Range range;
  std::size_t count = 2;
};

/// Values on a D-dimensional uniform grid (first input fastest), linear between nodes, held outside.
/// Evaluation is real-time: no allocation, no exception, 2^D loads. Building is set-up only.
template <std::size_t D>
class LookupTable {
 public:
  using Point = std::array<double, D>;

  LookupTable() = default;
  LookupTable(const std::array<GridAxis, D>& axes, const std::function<double(const Point&)>& function);
  /// From values in order, first axis fastest; as many as the product of the counts.
  LookupTable(const std::array<GridAxis, D>& axes, std::vector<double> values);

  [[nodiscard]] double operator()(const Point& x) const noexcept {
    std::size_t corner = 0;
    std::size_t stride = 1;
    Point fraction;
    std::array<std::size_t, D> step;
    for (std::size_t d = 0; d < D; ++d) {
      const double last = static_cast<double>(axes_[d].count - 1);
      double at = (x[d] - axes_[d].range.lower) * inverse_[d];
      at = at > 0.0 ? (at < last ? at : last) : 0.0;  // NaN goes to 0: held like any input outside
      const auto cell = static_cast<std::size_t>(at);
      const bool end = cell + 1 >= axes_[d].count;
      fraction[d] = end ? 0.0 : at - static_cast<double>(cell);
      step[d] = end ? 0 : stride;
      corner += cell * stride;
      stride *= axes_[d].count;
    }
    return interpolate<D>(corner, fraction, step);
  }

  [[nodiscard]] std::size_t size() const { return values_.size(); }
  [[nodiscard]] const std::array<GridAxis, D>& axes() const { return axes_; }
  [[nodiscard]] const std::vector<double>& values() const { return values_; }

 private:
  template <std::size_t K>
  [[nodiscard]] double interpolate(std::size_t corner, const Point& fraction,
                                   const std::array<std::size_t, D>& step) const noexcept {
    if constexpr (K == 0) {
      return values_[corner];
    } else {
      const double low = interpolate<K - 1>(corner, fraction, step);
      const double high = interpolate<K - 1>(corner + step[K - 1], fraction, step);
      return low + fraction[K - 1] * (high - low);
    }
  }

  std::size_t prepare();  // fills inverse_, returns the number of nodes

  std::array<GridAxis, D> axes_{};
  std::array<double, D> inverse_{};
  std::vector<double> values_ = std::vector<double>(1, 0.0);
};

/// A network as a table whose difference from it is nowhere above `bound`.
template <std::size_t D>
struct CompiledNetwork {
  LookupTable<D> table;
  double bound = 0.0;  // proven: sum over d of h_d^2 / 8 * max |d2f/dx_d2|, output units
};

/// Compiles `network` (D inputs) so that the proven bound is at most `tolerance` (output units), with at most
/// `most_nodes` nodes. Where those do not suffice, the bound that was reached is returned. Linear interpolation of f
/// errs by at most h^2/8 max|f''| a dimension, and RbfNetwork::curvature_bound bounds f''.
template <std::size_t D>
CompiledNetwork<D> compile(const RbfNetwork& network, double tolerance, std::size_t most_nodes = 1U << 20U);

extern template class LookupTable<1>;
extern template class LookupTable<2>;
extern template class LookupTable<3>;

}  // namespace invar::numerics
