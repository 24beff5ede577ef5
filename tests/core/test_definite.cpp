// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "core/base/error.hpp"
#include "core/solve/definite.hpp"
#include "kernels/layout.hpp"

namespace kerf {
namespace {

using Matrix = Eigen::Matrix<double, 24, 24>;
using Packed = std::array<double, kernels::kEntries>;

Packed packed(const Matrix& matrix) {
  Packed out{};
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j <= i; ++j)
      out[static_cast<std::size_t>(kernels::packed_index(i, j))] = matrix(i, j);
  return out;
}

Matrix unpacked(const Packed& from) {
  Matrix out;
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j <= i; ++j)
      out(i, j) = out(j, i) = from[static_cast<std::size_t>(kernels::packed_index(i, j))];
  return out;
}

// Orthonormal columns that have nothing to do with the axes.
Matrix basis() {
  Matrix seeds;
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) seeds(i, j) = std::sin(1.0 + 3 * i + 7 * j + i * j);
  return Eigen::HouseholderQR<Matrix>(seeds).householderQ();
}

Matrix with_eigenvalues(const Eigen::Matrix<double, 24, 1>& values) {
  const Matrix q = basis();
  const Matrix out = q * values.asDiagonal() * q.transpose();
  return 0.5 * (out + out.transpose());
}

TEST(MakeDefinite, LeavesWhatIsDefiniteButForRounding) {
  Eigen::Matrix<double, 24, 1> values = Eigen::Matrix<double, 24, 1>::LinSpaced(1, 24);
  values.head<6>().setZero();  // rigid motions
  const Packed before = packed(with_eigenvalues(values));
  Packed after = before;
  make_definite(after, 1e-6);
  EXPECT_EQ(after, before);
}

TEST(MakeDefinite, RaisesNegativeEigenvaluesAndNoOthers) {
  constexpr double kRounding = 1e-6, kGreatest = 24;
  Eigen::Matrix<double, 24, 1> values = Eigen::Matrix<double, 24, 1>::LinSpaced(1, kGreatest);
  values[0] = -1e-3;
  values[1] = 1e-9;
  Packed entries = packed(with_eigenvalues(values));
  make_definite(entries, kRounding);
  const auto found = Eigen::SelfAdjointEigenSolver<Matrix>(unpacked(entries)).eigenvalues();
  EXPECT_NEAR(found[0], kRounding * kGreatest, 1e-12);
  EXPECT_NEAR(found[1], kRounding * kGreatest, 1e-12);
  for (int i = 2; i < 24; ++i) EXPECT_NEAR(found[i], values[i], 1e-12) << i;
}

TEST(MakeDefinite, HeldRowsStayZero) {
  Eigen::Matrix<double, 24, 1> values = Eigen::Matrix<double, 24, 1>::LinSpaced(-1, 22);
  Matrix matrix = with_eigenvalues(values);
  for (const int held : {0, 5, 23}) {
    matrix.row(held).setZero();
    matrix.col(held).setZero();
  }
  Packed entries = packed(matrix);
  make_definite(entries, 1e-6);
  const Matrix after = unpacked(entries);
  for (const int held : {0, 5, 23}) EXPECT_TRUE(after.row(held).isZero(0)) << held;
  // Three are zero, of the held rows; all others are raised.
  const auto found = Eigen::SelfAdjointEigenSolver<Matrix>(after).eigenvalues();
  EXPECT_NEAR(found[2], 0, 1e-12);
  EXPECT_GT(found[3], 0.9e-6 * found[23]);

  Packed nothing{};
  make_definite(nothing, 1e-6);
  EXPECT_EQ(nothing, Packed{});
}

TEST(MakeDefinite, RaisesWhatIsNegativeThroughout) {
  Packed entries = packed(with_eigenvalues(-Eigen::Matrix<double, 24, 1>::Ones()));
  make_definite(entries, 1e-6);
  EXPECT_NEAR(Eigen::SelfAdjointEigenSolver<Matrix>(unpacked(entries)).eigenvalues()[0], 1e-6,
              1e-12);
}

TEST(MakeDefinite, RefusesAnotherSize) {
  std::vector<double> entries(299);
  EXPECT_THROW(make_definite(entries, 1e-6), Error);
}

}  // namespace
}  // namespace kerf
