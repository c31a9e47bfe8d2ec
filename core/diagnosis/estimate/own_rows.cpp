#include "core/diagnosis/estimate/own_rows.hpp"

#include <algorithm>

namespace invar::diagnosis {

OwnRows::OwnRows(const Eigen::MatrixXd& columns, const std::vector<bool>& may) {
  constexpr Eigen::Index apart = 64;  // shorter stretches of zeros are not worth a stretch of their own
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    std::vector<Own> stretches;
    if (may[static_cast<std::size_t>(k)])
      for (Eigen::Index i = 0; i < columns.rows(); ++i) {
        if (columns(i, k) == 0.0) continue;
        if (stretches.empty() || i >= stretches.back().last + apart)
          stretches.push_back({k, i, i + 1});
        else
          stretches.back().last = i + 1;
      }
    Eigen::Index rows = 0;
    for (const auto& one : stretches) rows += one.last - one.first;
    if (!may[static_cast<std::size_t>(k)] || 2 * rows > columns.rows())
      full_.push_back(k);
    else
      own_.insert(own_.end(), stretches.begin(), stretches.end());
  }
  std::stable_sort(own_.begin(), own_.end(), [](const Own& a, const Own& b) { return a.first < b.first; });
}

Eigen::MatrixXd OwnRows::normal(const Eigen::MatrixXd& columns) const {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
  const Eigen::MatrixXd full = columns(Eigen::all, full_);
  const auto n = static_cast<Eigen::Index>(full_.size());
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(n, n);
  if (n > 0) common.selfadjointView<Eigen::Lower>().rankUpdate(full.transpose());
  common = Eigen::MatrixXd{common.selfadjointView<Eigen::Lower>()};
  product(full_, full_) = common;
  const auto add = [&](Eigen::Index a, Eigen::Index b, double value) {
    product(a, b) += value;
    if (a != b) product(b, a) += value;
  };
  for (auto one = own_.begin(); one != own_.end(); ++one) {
    const auto mine = columns.col(one->column).segment(one->first, one->last - one->first);
    const Eigen::VectorXd with = full.middleRows(one->first, one->last - one->first).transpose() * mine;
    for (Eigen::Index k = 0; k < n; ++k) add(full_[static_cast<std::size_t>(k)], one->column, with(k));
    add(one->column, one->column, mine.squaredNorm());
    for (auto other = one + 1; other != own_.end() && other->first < one->last; ++other) {
      const Eigen::Index rows = std::min(one->last, other->last) - other->first;
      add(one->column, other->column,
          columns.col(one->column)
              .segment(other->first, rows)
              .dot(columns.col(other->column).segment(other->first, rows)));
    }
  }
  return product;
}

Eigen::VectorXd OwnRows::times(const Eigen::MatrixXd& columns, const Eigen::VectorXd& by) const {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(columns.cols());
  for (const auto k : full_) product(k) = columns.col(k).dot(by);
  for (const auto& one : own_)
    product(one.column) += columns.col(one.column)
                               .segment(one.first, one.last - one.first)
                               .dot(by.segment(one.first, one.last - one.first));
  return product;
}

void OwnRows::update(Eigen::MatrixXd& columns, const Eigen::VectorXd& error, const Eigen::VectorXd& taken,
                     const Eigen::VectorXd& scale) const {
  const Eigen::VectorXd by_scale = taken.cwiseQuotient(scale.cwiseProduct(scale));
  double common = 0.0;
  for (const auto k : full_) common += taken(k) * by_scale(k);
  Eigen::VectorXd share = Eigen::VectorXd::Constant(error.size(), common);  // of each row: what it moved by
  for (const auto& one : own_)
    share.segment(one.first, one.last - one.first).array() += taken(one.column) * by_scale(one.column);
  for (Eigen::Index i = 0; i < share.size(); ++i) share(i) = share(i) > 0.0 ? error(i) / share(i) : 0.0;
  for (const auto k : full_) columns.col(k) += by_scale(k) * share;
  for (const auto& one : own_)
    columns.col(one.column).segment(one.first, one.last - one.first) +=
        by_scale(one.column) * share.segment(one.first, one.last - one.first);
}

}  // namespace invar::diagnosis
