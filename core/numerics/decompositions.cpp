#include "core/numerics/decompositions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace invar::numerics {

using Eigen::MatrixXd;

SymmetricEigen symmetric_eigen(const Eigen::Ref<const MatrixXd>& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver{a};
  return {solver.eigenvalues(), solver.eigenvectors()};
}

std::optional<RealEigen> real_eigen(const Eigen::Ref<const MatrixXd>& a) {
  const Eigen::EigenSolver<MatrixXd> solver{a};
  if (solver.info() != Eigen::Success) return std::nullopt;
  return RealEigen{solver.eigenvalues().real(), solver.eigenvectors().real()};
}

MatrixXd full_q(const Eigen::Ref<const MatrixXd>& a) { return a.householderQr().householderQ(); }

Eigen::VectorXd singular_values(const Eigen::Ref<const MatrixXd>& a) {
  return Eigen::JacobiSVD<MatrixXd>{a}.singularValues();
}

MatrixXd nearest_orthogonal(const Eigen::Ref<const MatrixXd>& a) {
  const Eigen::JacobiSVD<MatrixXd> svd{a, Eigen::ComputeFullU | Eigen::ComputeFullV};
  return svd.matrixU() * svd.matrixV().transpose();
}

MatrixXd pseudo_inverse(const Eigen::Ref<const MatrixXd>& a) {
  return a.completeOrthogonalDecomposition().pseudoInverse();
}

Eigen::Index rank_of(const Eigen::Ref<const MatrixXd>& a) { return a.colPivHouseholderQr().rank(); }

MatrixXd solved(Decomposition by, const Eigen::Ref<const MatrixXd>& a, const Eigen::Ref<const MatrixXd>& b) {
  switch (by) {
    case Decomposition::ldlt:
      return a.ldlt().solve(b);
    case Decomposition::llt:
      return a.llt().solve(b);
    case Decomposition::lu:
      return a.partialPivLu().solve(b);
    case Decomposition::pivoted_qr:
      return a.colPivHouseholderQr().solve(b);
    case Decomposition::complete_orthogonal:
      return a.completeOrthogonalDecomposition().solve(b);
  }
  return {};
}

}  // namespace invar::numerics
