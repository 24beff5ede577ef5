// SPDX-License-Identifier: MIT
#include "core/solve/definite.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "core/base/error.hpp"
#include "kernels/layout.hpp"

namespace kerf {
namespace {

constexpr int kRows = 24;

std::size_t place(int i, int j) {
  return static_cast<std::size_t>(i >= j ? kernels::packed_index(i, j)
                                         : kernels::packed_index(j, i));
}

// Rows of held components are zero.
std::vector<int> free_rows(std::span<const double> packed) {
  std::vector<int> out;
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < kRows; ++j)
      if (packed[place(i, j)] != 0) {
        out.push_back(i);
        break;
      }
  return out;
}

// With a little of its own diagonal, as is one whose rigid motions are free.
bool is_definite(Eigen::MatrixXd matrix, double rounding) {
  if (!(matrix.diagonal().minCoeff() > 0)) return false;
  matrix.diagonal() *= 1 + rounding;
  return Eigen::LLT<Eigen::MatrixXd>(matrix).info() == Eigen::Success;
}

}  // namespace

void make_definite(std::span<double> packed, double rounding) {
  ensures(packed.size() == kernels::kEntries, "a packed cell matrix has 300 entries");
  const std::vector<int> rows = free_rows(packed);
  const auto n = static_cast<int>(rows.size());
  if (n == 0) return;
  Eigen::MatrixXd matrix(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) matrix(i, j) = packed[place(rows[i], rows[j])];
  if (is_definite(matrix, rounding)) return;

  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(matrix);
  expects(parts.info() == Eigen::Success, "a cell matrix has entries that are not finite");
  const double least = rounding * parts.eigenvalues().cwiseAbs().maxCoeff();
  matrix = parts.eigenvectors() * parts.eigenvalues().cwiseMax(least).asDiagonal() *
           parts.eigenvectors().transpose();
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) packed[place(rows[i], rows[j])] = matrix(i, j);
}

}  // namespace kerf
