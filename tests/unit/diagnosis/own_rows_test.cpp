// Columns of windows against the plain products of full matrices.
#include "core/diagnosis/estimate/own_rows.hpp"

#include <gtest/gtest.h>

namespace invar::diagnosis {
namespace {

/// Three full columns and eight that have 150 rows each of 1200; neighbours overlap by ten, as whitening makes them.
Eigen::MatrixXd columns_of_windows() {
  std::srand(7);
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(1200, 11);
  columns.leftCols(3).setRandom();
  for (Eigen::Index k = 0; k < 8; ++k) columns.col(3 + k).segment(150 * k, k < 7 ? 160 : 150).setRandom();
  columns(400, 1) = 0.0;
  return columns;
}

const std::vector<bool> may{false, false, false, true, true, true, true, true, true, true, true};

TEST(OwnRows, ProductsAreThoseOfTheFullMatrices) {
  const auto columns = columns_of_windows();
  const OwnRows rows{columns, may};
  ASSERT_TRUE(rows.any());
  EXPECT_LT((rows.normal(columns) - columns.transpose() * columns).norm(), 1e-10);
  const Eigen::VectorXd by = Eigen::VectorXd::Random(1200);
  EXPECT_LT((rows.times(columns, by) - columns.transpose() * by).norm(), 1e-10);
}

TEST(OwnRows, StatesAloneHaveNoFullColumn) {
  const Eigen::MatrixXd columns = columns_of_windows().rightCols(8);
  const OwnRows rows{columns, std::vector<bool>(8, true)};
  ASSERT_TRUE(rows.any());
  EXPECT_LT((rows.normal(columns) - columns.transpose() * columns).norm(), 1e-10);
}

TEST(OwnRows, AnUpdateGivesTheChangeThatWasSeenAndLeavesZeros) {
  auto columns = columns_of_windows();
  const auto before = columns;
  const OwnRows rows{columns, may};
  const Eigen::VectorXd taken = Eigen::VectorXd::Random(11), error = Eigen::VectorXd::Random(1200);
  rows.update(columns, error, taken, Eigen::VectorXd::Constant(11, 0.5));
  EXPECT_LT((columns * taken - before * taken - error).norm(), 1e-10);
  for (Eigen::Index k = 3; k < 11; ++k)
    for (Eigen::Index i = 0; i < 1200; ++i)
      if (i < 150 * (k - 3) || i >= 150 * (k - 2) + 10) {
        EXPECT_EQ(columns(i, k), 0.0);
      }
}

TEST(OwnRows, WhereNoColumnHasFewRowsAllAreFull) {
  const Eigen::MatrixXd columns = Eigen::MatrixXd::Random(300, 4);
  const OwnRows rows{columns, std::vector<bool>(4, true)};
  EXPECT_FALSE(rows.any());
  EXPECT_LT((rows.normal(columns) - columns.transpose() * columns).norm(), 1e-10);
}

}  // namespace
}  // namespace invar::diagnosis
