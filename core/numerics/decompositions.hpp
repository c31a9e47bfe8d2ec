// Decompositions of matrices as functions, compiled once: a source that instantiates Eigen's own takes up to a minute of a first
// build. Not for the loop: they allocate.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace invar::numerics {

/// A symmetric matrix: its eigenvalues in ascending order, eigenvectors as columns. Eigen's SelfAdjointEigenSolver.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::Ref<const Eigen::MatrixXd>& a);

/// Any square matrix: the real parts, in no order; nothing where the iteration does not converge. Eigen's EigenSolver.
struct RealEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
std::optional<RealEigen> real_eigen(const Eigen::Ref<const Eigen::MatrixXd>& a);

/// The orthogonal matrix of `a` = Q R, rows by rows: its columns beyond those of `a` span the rest. Householder.
Eigen::MatrixXd full_q(const Eigen::Ref<const Eigen::MatrixXd>& a);
/// In descending order. Jacobi.
Eigen::VectorXd singular_values(const Eigen::Ref<const Eigen::MatrixXd>& a);
/// U V' of the singular value decomposition of a square matrix. Jacobi.
Eigen::MatrixXd nearest_orthogonal(const Eigen::Ref<const Eigen::MatrixXd>& a);
/// By a complete orthogonal decomposition.
Eigen::MatrixXd pseudo_inverse(const Eigen::Ref<const Eigen::MatrixXd>& a);
/// Columns that no others make up.
Eigen::Index rank_of(const Eigen::Ref<const Eigen::MatrixXd>& a);

enum class Decomposition { ldlt, llt, lu, pivoted_qr, complete_orthogonal };
/// x of a x = b; a least-squares solution where `a` has more rows than columns (QR, complete orthogonal).
Eigen::MatrixXd solved(Decomposition by, const Eigen::Ref<const Eigen::MatrixXd>& a,
                       const Eigen::Ref<const Eigen::MatrixXd>& b);

template <class B>
using Solution = Eigen::Matrix<double, Eigen::Dynamic, B::ColsAtCompileTime>;

/// For a symmetric matrix that is positive or negative semidefinite.
template <class B>
Solution<B> solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::MatrixBase<B>& b) {
  return solved(Decomposition::ldlt, a, b);
}
/// For a symmetric matrix that is positive definite.
template <class B>
Solution<B> solve_positive(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::MatrixBase<B>& b) {
  return solved(Decomposition::llt, a, b);
}
/// For any square matrix that has an inverse.
template <class B>
Solution<B> solve_square(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::MatrixBase<B>& b) {
  return solved(Decomposition::lu, a, b);
}
/// Least squares; columns that others make up get 0.
template <class B>
Solution<B> least_squares(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::MatrixBase<B>& b) {
  return solved(Decomposition::pivoted_qr, a, b);
}
/// The shortest of the least-squares solutions.
template <class B>
Solution<B> shortest_least_squares(const Eigen::Ref<const Eigen::MatrixXd>& a,
                                   const Eigen::MatrixBase<B>& b) {
  return solved(Decomposition::complete_orthogonal, a, b);
}

}  // namespace invar::numerics
