// Sensitivities of windows: what a state at the beginning of one moves are the rows of that window alone, so that most of a
// hundred columns are zeros, which need be neither multiplied nor filled.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace invar::diagnosis {

/// Which columns of a matrix have few rows of their own, and which rows.
class OwnRows {
 public:
  OwnRows() = default;  // of no columns
  /// `may`: the columns that are looked at; all others count as full. Those full of rows all the same are so too.
  OwnRows(const Eigen::MatrixXd& columns, const std::vector<bool>& may);
  [[nodiscard]] bool any() const { return !own_.empty(); }

  /// columns^T columns.
  [[nodiscard]] Eigen::MatrixXd normal(const Eigen::MatrixXd& columns) const;
  /// columns^T by.
  [[nodiscard]] Eigen::VectorXd times(const Eigen::MatrixXd& columns, const Eigen::VectorXd& by) const;
  /// Broyden's rule row by row: the least change, in the scales of the numbers, with which the columns times `taken` are by
  /// `error` more, while what was zero stays so (Schubert 1970).
  void update(Eigen::MatrixXd& columns, const Eigen::VectorXd& error, const Eigen::VectorXd& taken,
              const Eigen::VectorXd& scale) const;

 private:
  struct Own {
    Eigen::Index column = 0, first = 0,
                 last = 0;  // rows first to last - 1; a column of several outputs has several
  };
  std::vector<Eigen::Index> full_;
  std::vector<Own> own_;  // by the first row
};

}  // namespace invar::diagnosis
