// Columns of windows against the plain products of full matrices.
#include "core/diagnosis/estimate/columns.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace invar::diagnosis {
namespace {

/// `full` full columns before eight that have 150 rows each of 1200; neighbours overlap by ten, as whitening makes them.
Columns columns_of_windows(Eigen::Index full) {
  std::srand(7);
  std::vector<Eigen::Index> places;
  for (Eigen::Index k = 0; k < full; ++k) places.push_back(k);
  std::vector<Columns::Stretch> stretches;
  for (Eigen::Index k = 0; k < 8; ++k)
    stretches.push_back({full + k, 150 * k, Eigen::VectorXd::Random(k < 7 ? 160 : 150)});
  return {full + 8, Eigen::MatrixXd::Random(1200, full), places, stretches};
}

TEST(Columns, ProductsAreThoseOfTheFullMatrices) {
  for (const Eigen::Index full : {0, 3, 50}) {
    const auto columns = columns_of_windows(full);
    const auto dense = columns.dense();
    EXPECT_LT((columns.normal() - dense.transpose() * dense).norm(), 1e-9) << full;
    const Eigen::VectorXd rows = Eigen::VectorXd::Random(1200), by = Eigen::VectorXd::Random(full + 8);
    EXPECT_LT((columns.transpose_times(rows) - dense.transpose() * rows).norm(), 1e-10) << full;
    EXPECT_LT((columns.times(by) - dense * by).norm(), 1e-10) << full;
    for (Eigen::Index k = 0; k < full + 8; ++k) EXPECT_EQ(columns.col(k), dense.col(k));
  }
}

TEST(Columns, AnUpdateGivesTheChangeThatWasSeenAndLeavesZeros) {
  auto columns = columns_of_windows(3);
  const auto before = columns;
  const Eigen::VectorXd taken = Eigen::VectorXd::Random(11), error = Eigen::VectorXd::Random(1200);
  columns.update(error, taken, Eigen::VectorXd::Constant(11, 0.5));
  EXPECT_LT((columns.times(taken) - before.times(taken) - error).norm(), 1e-10);
  for (Eigen::Index k = 3; k < 11; ++k)
    for (Eigen::Index i = 0; i < 1200; ++i)
      if (i < 150 * (k - 3) || i >= 150 * (k - 2) + 10) {
        EXPECT_EQ(columns.col(k)(i), 0.0);
      }
}

TEST(Columns, AreDividedAndJoinedColumnByColumn) {
  auto columns = columns_of_windows(2);
  const auto before = columns.dense();
  columns.divide(0, 2.0), columns.divide(5, 4.0);
  EXPECT_LT((columns.col(0) - before.col(0) / 2.0).norm(), 1e-12);
  EXPECT_LT((columns.col(5) - before.col(5) / 4.0).norm(), 1e-12);
  const Eigen::MatrixXd further = Eigen::MatrixXd::Random(1200, 2);
  const auto more = columns.with(further);
  EXPECT_EQ(more.cols(), 12);
  EXPECT_EQ(more.dense().rightCols(2), further);
  const std::vector<Eigen::Index> some{-1, 2, 0, -1, -1, -1, -1, -1, -1, -1}, one{1, -1};
  const auto all = joined(3, {{columns, some}, {Columns{further}, one}}).dense();
  EXPECT_EQ(all.col(0), columns.col(2));
  EXPECT_EQ(all.col(1), further.col(0));
  EXPECT_EQ(all.col(2), columns.col(1));
}

TEST(Columns, OutsideOfTheirMatrixAreRefused) {
  const auto outside = [] {
    return Columns(2, Eigen::MatrixXd::Zero(5, 1), {0}, {{1, 3, Eigen::VectorXd::Ones(3)}});
  };
  EXPECT_THROW(outside(), std::logic_error);
}

}  // namespace
}  // namespace invar::diagnosis
