#include "core/numerics/lookup_table.hpp"

#include <algorithm>
#include <utility>

#include "core/base/contract.hpp"

namespace invar::numerics {

template <std::size_t D>
std::size_t LookupTable<D>::prepare() {
  std::size_t total = 1;
  for (std::size_t d = 0; d < D; ++d) {
    INVAR_EXPECTS(axes_[d].count >= 1 && axes_[d].range.width() >= 0.0, axes_[d].count);
    const double width = axes_[d].range.width();
    inverse_[d] = width > 0.0 ? static_cast<double>(axes_[d].count - 1) / width : 0.0;
    total *= axes_[d].count;
  }
  return total;
}

template <std::size_t D>
LookupTable<D>::LookupTable(const std::array<GridAxis, D>& axes, std::vector<double> values)
    : axes_{axes}, values_{std::move(values)} {
  const std::size_t total = prepare();
  INVAR_EXPECTS(values_.size() == total, values_.size(), total);
}

template <std::size_t D>
LookupTable<D>::LookupTable(const std::array<GridAxis, D>& axes,
                            const std::function<double(const Point&)>& function)
    : axes_{axes} {
  const std::size_t total = prepare();
  values_.resize(total);
  for (std::size_t k = 0; k < total; ++k) {
    Point x;
    std::size_t rest = k;
    for (std::size_t d = 0; d < D; ++d) {
      const std::size_t n = axes[d].count;
      const double fraction = n > 1 ? static_cast<double>(rest % n) / static_cast<double>(n - 1) : 0.0;
      x[d] = axes[d].range.lower + fraction * axes[d].range.width();
      rest /= n;
    }
    values_[k] = function(x);
  }
}

template <std::size_t D>
CompiledNetwork<D> compile(const RbfNetwork& network, double tolerance, std::size_t most_nodes) {
  INVAR_EXPECTS(network.inputs() == static_cast<Eigen::Index>(D) && tolerance > 0.0, network.inputs());
  std::array<GridAxis, D> axes;
  std::array<double, D> intervals{};
  double total = 1.0;
  for (std::size_t d = 0; d < D; ++d) {
    // Each dimension gets an equal share of the tolerance: h = sqrt(8 tolerance / (D f'')).
    const double curvature = network.curvature_bound(static_cast<Eigen::Index>(d));
    const double width = network.range[d].width();
    intervals[d] = std::max(1.0, std::ceil(width * std::sqrt(curvature * D / (8.0 * tolerance))));
    total *= intervals[d] + 1.0;
  }
  const double shrink = std::min(1.0, std::pow(static_cast<double>(most_nodes) / total, 1.0 / D));
  CompiledNetwork<D> compiled;
  for (std::size_t d = 0; d < D; ++d) {
    const double kept = std::max(1.0, std::floor(intervals[d] * shrink));
    axes[d] = {network.range[d], static_cast<std::size_t>(kept) + 1};
    const double h = network.range[d].width() / kept;
    compiled.bound += h * h / 8.0 * network.curvature_bound(static_cast<Eigen::Index>(d));
  }
  compiled.table = LookupTable<D>{axes, [&](const std::array<double, D>& x) {
                                    return network(Eigen::Map<const Eigen::VectorXd>(x.data(), D));
                                  }};
  return compiled;
}

template class LookupTable<1>;
template class LookupTable<2>;
template class LookupTable<3>;
template CompiledNetwork<1> compile<1>(const RbfNetwork&, double, std::size_t);
template CompiledNetwork<2> compile<2>(const RbfNetwork&, double, std::size_t);
template CompiledNetwork<3> compile<3>(const RbfNetwork&, double, std::size_t);

}  // namespace invar::numerics
