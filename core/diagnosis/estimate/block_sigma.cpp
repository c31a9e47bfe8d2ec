#include "core/diagnosis/estimate/block_sigma.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/estimate/sensitivities.hpp"

namespace invar::diagnosis {

namespace {

constexpr std::size_t all_blocks =
    20;  // fewer tell little of a spread, more are shorter than what is left goes on

std::size_t blocks_of(const Case& data) {
  const std::size_t recordings = std::max<std::size_t>(1, data.recordings.size());
  return std::max<std::size_t>(1, all_blocks / recordings);
}

/// By block, what it pulls at each freedom: the columns times what is left there.
Eigen::MatrixXd pulls(const Case& data, const Eigen::MatrixXd& columns, const Eigen::VectorXd& left) {
  const std::size_t each = blocks_of(data);
  Eigen::MatrixXd sums =
      Eigen::MatrixXd::Zero(columns.cols(), static_cast<Eigen::Index>(each * data.recordings.size()));
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const std::size_t rows = data.recordings[r].inputs.rows();
      for (std::size_t block = 0; block < each; ++block) {
        const auto begin = static_cast<Eigen::Index>(rows * block / each),
                   end = static_cast<Eigen::Index>(rows * (block + 1) / each);
        sums.col(static_cast<Eigen::Index>(r * each + block)) +=
            columns.middleRows(at + begin, end - begin).transpose() * left.segment(at + begin, end - begin);
      }
      at += static_cast<Eigen::Index>(rows);
    }
  return sums;
}

}  // namespace

Eigen::VectorXd sigma_over_blocks(const Case& data, const Weighing& weighing, const Fit& fit) {
  if (fit.free.empty()) return fit.sigma;
  const auto columns = whitened(data, weighing, sensitivities(data, fit.model, fit.free)).dense();
  const Eigen::MatrixXd moved = weighing.temper * (fit.covariance * pulls(data, columns, fit.residual));
  const auto blocks = static_cast<double>(moved.cols());
  if (blocks < 2.0) return fit.sigma;
  const Eigen::VectorXd spread = (moved.rowwise().squaredNorm() * (blocks / (blocks - 1.0))).cwiseSqrt();
  return fit.sigma.cwiseMax(spread.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; }));
}

}  // namespace invar::diagnosis
