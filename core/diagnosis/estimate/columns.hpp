// Columns of a Jacobian. A state at the beginning of a window moves the rows of that window alone. Such a column is kept as
// these rows, so that zeros are neither stored nor filtered nor multiplied.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace invar::diagnosis {

class Columns {
 public:
  /// Consecutive rows of a column; all other rows of it are zero.
  struct Stretch {
    Eigen::Index column = 0, first = 0;
    Eigen::VectorXd values;
    [[nodiscard]] Eigen::Index last() const { return first + values.size(); }  // one behind
  };

  Columns() = default;  // no rows, no columns
  /// All full.
  explicit Columns(Eigen::MatrixXd full);
  /// Some full, in the places `full_at`; the others hold what `stretches` say. Throws std::logic_error where a place is
  /// outside.
  Columns(Eigen::Index cols, Eigen::MatrixXd full, std::vector<Eigen::Index> full_at,
          std::vector<Stretch> stretches);

  [[nodiscard]] Eigen::Index rows() const { return full_.rows(); }
  [[nodiscard]] Eigen::Index cols() const { return cols_; }
  [[nodiscard]] const Eigen::MatrixXd& full() const { return full_; }
  [[nodiscard]] const std::vector<Eigen::Index>& full_at() const { return full_at_; }
  [[nodiscard]] const std::vector<Stretch>& stretches() const { return stretches_; }

  [[nodiscard]] Eigen::VectorXd col(Eigen::Index k) const;
  [[nodiscard]] Eigen::MatrixXd dense() const;
  /// With further full columns behind these.
  [[nodiscard]] Columns with(const Eigen::MatrixXd& further) const;

  /// columns^T columns.
  [[nodiscard]] Eigen::MatrixXd normal() const;
  /// columns^T by.
  [[nodiscard]] Eigen::VectorXd transpose_times(const Eigen::VectorXd& by) const;
  /// columns by.
  [[nodiscard]] Eigen::VectorXd times(const Eigen::VectorXd& by) const;

  void divide(Eigen::Index column, double factor);
  /// Broyden's rule row by row (Schubert 1970). It is the least change, in the scales of the numbers, with which the columns
  /// times `taken` are by `error` more. Zeros stay zeros.
  void update(const Eigen::VectorXd& error, const Eigen::VectorXd& taken, const Eigen::VectorXd& scale);

 private:
  Eigen::Index cols_ = 0;
  Eigen::MatrixXd full_;
  std::vector<Eigen::Index> full_at_;
  std::vector<Stretch> stretches_;  // by the first row
};

/// Columns of several, each in the place that its list says; -1 leaves it out.
Columns joined(Eigen::Index cols,
               const std::vector<std::pair<const Columns&, const std::vector<Eigen::Index>&>>& parts);

}  // namespace invar::diagnosis
