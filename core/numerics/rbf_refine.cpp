#include "core/numerics/rbf_refine.hpp"

#include <ceres/ceres.h>

#include <cmath>
#include <vector>

namespace invar::numerics {

namespace {

/// Parameters: constant, D slopes, M weights, D*M centres, D*M log widths. One residual a reading, plus a
/// weak pull of centres and widths to where they began, without which two equal centres make the problem
/// singular.
class Residuals final : public ceres::CostFunction {
 public:
  Residuals(const RbfNetwork& net, Eigen::MatrixXd u, Eigen::VectorXd target)
      : inputs_{net.inputs()},
        size_{net.size()},
        u_{std::move(u)},
        target_{std::move(target)},
        centres_{net.centres},
        log_widths_{net.widths.array().log()},
        widths_{net.widths} {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(count()));
    set_num_residuals(static_cast<int>(target_.size() + 2 * inputs_ * size_));
  }

  [[nodiscard]] Eigen::Index count() const { return 1 + inputs_ + size_ + 2 * inputs_ * size_; }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::VectorXd> p{parameters[0], count()};
    const Eigen::Map<const Eigen::VectorXd> weights{p.data() + 1 + inputs_, size_};
    const Eigen::Map<const Eigen::MatrixXd> centres{weights.data() + size_, inputs_, size_};
    const Eigen::Map<const Eigen::MatrixXd> log_widths{centres.data() + inputs_ * size_, inputs_, size_};
    const Eigen::MatrixXd inverse = (-log_widths.array()).exp();
    const Eigen::Index n = target_.size();
    const Eigen::Index pulls = inputs_ * size_;
    Eigen::Map<Eigen::VectorXd> r{residuals, n + 2 * pulls};
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    double* jacobian = jacobians != nullptr ? jacobians[0] : nullptr;
    if (jacobian != nullptr) Eigen::Map<RowMajor>{jacobian, r.size(), count()}.setZero();
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::MatrixXd z = ((-centres).colwise() + u_.col(i)).cwiseProduct(inverse);
      const Eigen::VectorXd phi = (-0.5 * z.colwise().squaredNorm()).array().exp();
      r(i) = p(0) + p.segment(1, inputs_).dot(u_.col(i)) + weights.dot(phi) - target_(i);
      if (jacobian == nullptr) continue;
      Eigen::Map<Eigen::VectorXd> row{jacobian + i * count(), count()};
      row(0) = 1.0;
      row.segment(1, inputs_) = u_.col(i);
      row.segment(1 + inputs_, size_) = phi;
      const Eigen::VectorXd lever = weights.cwiseProduct(phi);
      const Eigen::MatrixXd by_centre = z.cwiseProduct(inverse) * lever.asDiagonal();
      const Eigen::MatrixXd by_width = z.cwiseAbs2() * lever.asDiagonal();
      row.segment(1 + inputs_ + size_, pulls) = by_centre.reshaped();
      row.segment(1 + inputs_ + size_ + pulls, pulls) = by_width.reshaped();
    }
    constexpr double pull = 1e-3;
    const Eigen::MatrixXd moved = (centres - centres_).cwiseQuotient(widths_);
    r.segment(n, pulls) = pull * moved.reshaped();
    r.segment(n + pulls, pulls) = pull * (log_widths - log_widths_).reshaped();
    if (jacobian != nullptr) {
      for (Eigen::Index k = 0; k < pulls; ++k) {
        jacobian[(n + k) * count() + 1 + inputs_ + size_ + k] = pull / widths_.reshaped()(k);
        jacobian[(n + pulls + k) * count() + 1 + inputs_ + size_ + pulls + k] = pull;
      }
    }
    return r.allFinite();
  }

 private:
  Eigen::Index inputs_;
  Eigen::Index size_;
  Eigen::MatrixXd u_;
  Eigen::VectorXd target_;
  Eigen::MatrixXd centres_;
  Eigen::MatrixXd log_widths_;
  Eigen::MatrixXd widths_;
};

double rms(const RbfNetwork& net, const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
  double squares = 0.0;
  for (Eigen::Index i = 0; i < y.size(); ++i) squares += std::pow(net(x.col(i)) - y(i), 2);
  return std::sqrt(squares / static_cast<double>(y.size()));
}

}  // namespace

RefineResult refine(const RbfNetwork& start, const Eigen::Ref<const Eigen::MatrixXd>& x,
                    const Eigen::Ref<const Eigen::VectorXd>& y, int most_iterations) {
  RefineResult result;
  result.rms_before = rms(start, x, y);
  const Eigen::Index inputs = start.inputs();
  const Eigen::Index size = start.size();
  Eigen::MatrixXd u(inputs, x.cols());
  for (Eigen::Index i = 0; i < x.cols(); ++i) u.col(i) = start.scaled(x.col(i));
  auto* residuals = new Residuals{start, u, (y.array() - start.output_offset) / start.output_scale};
  Eigen::VectorXd p(residuals->count());
  p << start.constant, start.slope, start.weights, start.centres.reshaped(),
      start.widths.array().log().matrix().reshaped();
  ceres::Problem problem;
  problem.AddResidualBlock(residuals, nullptr, p.data());  // the problem owns it
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = most_iterations;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  result.network = start;
  result.network.constant = p(0);
  result.network.slope = p.segment(1, inputs);
  result.network.weights = p.segment(1 + inputs, size);
  result.network.centres = p.segment(1 + inputs + size, inputs * size).reshaped(inputs, size);
  result.network.widths = p.tail(inputs * size).array().exp().matrix().reshaped(inputs, size);
  result.rms_after = rms(result.network, x, y);
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

}  // namespace invar::numerics
