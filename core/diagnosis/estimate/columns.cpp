#include "core/diagnosis/estimate/columns.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace invar::diagnosis {

Columns::Columns(Eigen::MatrixXd full)
    : cols_{full.cols()}, full_{std::move(full)}, full_at_(static_cast<std::size_t>(cols_)) {
  std::iota(full_at_.begin(), full_at_.end(), Eigen::Index{0});
}

Columns::Columns(Eigen::Index cols, Eigen::MatrixXd full, std::vector<Eigen::Index> full_at,
                 std::vector<Stretch> stretches)
    : cols_{cols}, full_{std::move(full)}, full_at_{std::move(full_at)}, stretches_{std::move(stretches)} {
  const auto is_outside = [&](Eigen::Index column) { return column < 0 || column >= cols_; };
  if (full_.cols() != static_cast<Eigen::Index>(full_at_.size()) ||
      std::any_of(full_at_.begin(), full_at_.end(), is_outside) ||
      std::any_of(stretches_.begin(), stretches_.end(), [&](const Stretch& one) {
        return is_outside(one.column) || one.first < 0 || one.last() > full_.rows();
      }))
    throw std::logic_error{"columns outside of their matrix"};
  std::stable_sort(stretches_.begin(), stretches_.end(),
                   [](const Stretch& a, const Stretch& b) { return a.first < b.first; });
}

Eigen::VectorXd Columns::col(Eigen::Index k) const {
  for (std::size_t f = 0; f < full_at_.size(); ++f)
    if (full_at_[f] == k) return full_.col(static_cast<Eigen::Index>(f));
  Eigen::VectorXd column = Eigen::VectorXd::Zero(rows());
  for (const auto& one : stretches_)
    if (one.column == k) column.segment(one.first, one.values.size()) = one.values;
  return column;
}

Eigen::MatrixXd Columns::dense() const {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows(), cols_);
  for (std::size_t f = 0; f < full_at_.size(); ++f)
    all.col(full_at_[f]) = full_.col(static_cast<Eigen::Index>(f));
  for (const auto& one : stretches_) all.col(one.column).segment(one.first, one.values.size()) = one.values;
  return all;
}

Columns Columns::with(const Eigen::MatrixXd& further) const {
  Columns all = *this;
  all.full_.conservativeResize(further.rows(), full_.cols() + further.cols());
  all.full_.rightCols(further.cols()) = further;
  for (Eigen::Index k = 0; k < further.cols(); ++k) all.full_at_.push_back(all.cols_++);
  return all;
}

Eigen::MatrixXd Columns::normal() const {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(cols_, cols_);
  constexpr Eigen::Index many = 40;  // beyond, half of the products are saved
  if (full_.cols() <= many) {
    product(full_at_, full_at_) = full_.transpose() * full_;
  } else {
    Eigen::MatrixXd half = Eigen::MatrixXd::Zero(full_.cols(), full_.cols());
    half.selfadjointView<Eigen::Lower>().rankUpdate(full_.transpose());
    product(full_at_, full_at_) = Eigen::MatrixXd{half.selfadjointView<Eigen::Lower>()};
  }
  const auto add = [&](Eigen::Index a, Eigen::Index b, double value) {
    product(a, b) += value;
    if (a != b) product(b, a) += value;
  };
  for (auto one = stretches_.begin(); one != stretches_.end(); ++one) {
    const Eigen::VectorXd with = full_.middleRows(one->first, one->values.size()).transpose() * one->values;
    for (std::size_t f = 0; f < full_at_.size(); ++f)
      add(full_at_[f], one->column, with(static_cast<Eigen::Index>(f)));
    add(one->column, one->column, one->values.squaredNorm());
    for (auto other = one + 1; other != stretches_.end() && other->first < one->last(); ++other) {
      const Eigen::Index rows = std::min(one->last(), other->last()) - other->first;
      add(one->column, other->column,
          one->values.segment(other->first - one->first, rows).dot(other->values.head(rows)));
    }
  }
  return product;
}

Eigen::VectorXd Columns::transpose_times(const Eigen::VectorXd& by) const {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(cols_);
  const Eigen::VectorXd of_full = full_.transpose() * by;
  product(full_at_) = of_full;
  for (const auto& one : stretches_)
    product(one.column) += one.values.dot(by.segment(one.first, one.values.size()));
  return product;
}

Eigen::VectorXd Columns::times(const Eigen::VectorXd& by) const {
  const Eigen::VectorXd of_full = by(full_at_);
  Eigen::VectorXd product = full_ * of_full;
  for (const auto& one : stretches_)
    product.segment(one.first, one.values.size()) += by(one.column) * one.values;
  return product;
}

void Columns::divide(Eigen::Index column, double factor) {
  for (std::size_t f = 0; f < full_at_.size(); ++f)
    if (full_at_[f] == column) full_.col(static_cast<Eigen::Index>(f)) /= factor;
  for (auto& one : stretches_)
    if (one.column == column) one.values /= factor;
}

void Columns::update(const Eigen::VectorXd& error, const Eigen::VectorXd& taken,
                     const Eigen::VectorXd& scale) {
  const Eigen::VectorXd by_scale = taken.cwiseQuotient(scale.cwiseProduct(scale));
  double common = 0.0;
  for (const auto k : full_at_) common += taken(k) * by_scale(k);
  Eigen::VectorXd share = Eigen::VectorXd::Constant(error.size(), common);  // of each row: what it moved by
  for (const auto& one : stretches_)
    share.segment(one.first, one.values.size()).array() += taken(one.column) * by_scale(one.column);
  for (Eigen::Index i = 0; i < share.size(); ++i) share(i) = share(i) > 0.0 ? error(i) / share(i) : 0.0;
  for (std::size_t f = 0; f < full_at_.size(); ++f)
    full_.col(static_cast<Eigen::Index>(f)) += by_scale(full_at_[f]) * share;
  for (auto& one : stretches_)
    one.values += by_scale(one.column) * share.segment(one.first, one.values.size());
}

Columns joined(Eigen::Index cols,
               const std::vector<std::pair<const Columns&, const std::vector<Eigen::Index>&>>& parts) {
  std::vector<Eigen::Index> full_at;
  std::vector<Columns::Stretch> stretches;
  Eigen::Index rows = 0;
  for (const auto& [columns, to] : parts) {
    rows = std::max(rows, columns.rows());
    for (const auto place : columns.full_at())
      if (const auto k = to[static_cast<std::size_t>(place)]; k >= 0) full_at.push_back(k);
    for (const auto& one : columns.stretches())
      if (const auto k = to[static_cast<std::size_t>(one.column)]; k >= 0)
        stretches.push_back({k, one.first, one.values});
  }
  Eigen::MatrixXd full(rows, static_cast<Eigen::Index>(full_at.size()));
  Eigen::Index next = 0;
  for (const auto& [columns, to] : parts)
    for (std::size_t f = 0; f < columns.full_at().size(); ++f)
      if (to[static_cast<std::size_t>(columns.full_at()[f])] >= 0)
        full.col(next++) = columns.full().col(static_cast<Eigen::Index>(f));
  return {cols, std::move(full), std::move(full_at), std::move(stretches)};
}

}  // namespace invar::diagnosis
